//! Finds PETSc and the MPI library that it was built with, and passes on how they were built:
//!
//! - `cfg(open_mpi)`: MPI handles are pointers, as in Open MPI; without it, they are integers, as in MPICH;
//! - `cfg(wide_indices)`: PETSc indices have 64 bits.

use std::path::{Path, PathBuf};
use std::process::Command;

/// The message for a machine without PETSc.
const MISSING: &str = "The feature `petsc` needs PETSc 3.18 or later, built with MPI, with MUMPS and with real numbers in \
     double precision, and pkg-config must find it. On Debian or Ubuntu, install libpetsc-real-dev, pkg-config and \
     openmpi-bin; elsewhere, set PETSC_DIR, and PETSC_ARCH unless PETSc was installed into a prefix, such that \
     $PETSC_DIR/$PETSC_ARCH/lib/pkgconfig/PETSc.pc exists.";

fn main() {
    println!("cargo::rustc-check-cfg=cfg(open_mpi)");
    println!("cargo::rustc-check-cfg=cfg(wide_indices)");
    for variable in ["PETSC_DIR", "PETSC_ARCH", "PKG_CONFIG_PATH"] {
        println!("cargo::rerun-if-env-changed={variable}");
    }
    println!("cargo::rerun-if-changed=build.rs");
    if std::env::var_os("CARGO_FEATURE_PETSC").is_none() {
        return;
    }
    if let Err(reason) = configure() {
        // Cargo prints only this message, and ends.
        println!("cargo::error={MISSING} ({reason})");
    }
}

fn configure() -> Result<(), String> {
    if let Some(directory) = chosen()
        && !["PETSc.pc", "petsc.pc"].iter().any(|name| directory.join(name).exists())
    {
        return Err(format!("{} has no PETSc.pc", directory.display()));
    }
    let petsc = Package::find("PETSc").or_else(|_| Package::find("petsc"))?;
    let header = petsc.header("petscconf.h")?;
    let text = std::fs::read_to_string(&header).map_err(|error| format!("{}: {error}", header.display()))?;
    println!("cargo::rerun-if-changed={}", header.display());
    let defines = |name: &str| text.lines().any(|line| line.starts_with("#define") && line.contains(name));
    if defines("PETSC_USE_COMPLEX") || !defines("PETSC_USE_REAL_DOUBLE") {
        return Err(format!("{} is not for real numbers in double precision", header.display()));
    }
    if defines("PETSC_USE_64BIT_INDICES ") {
        println!("cargo::rustc-cfg=wide_indices");
    }
    let open_mpi = defines("PETSC_HAVE_OMPI_") || defines("PETSC_HAVE_OPENMPI");
    if open_mpi {
        println!("cargo::rustc-cfg=open_mpi");
    } else if !defines("PETSC_HAVE_MPICH") && !defines("PETSC_HAVE_I_MPI") && !defines("PETSC_HAVE_MSMPI") {
        return Err(format!("{} names neither Open MPI nor MPICH", header.display()));
    }
    let mut flags = petsc.ask(&["--libs", "--keep-system-libs"])?;
    let names: &[&str] = if open_mpi { &["ompi-c", "ompi"] } else { &["mpich", "impi"] };
    match names.iter().find_map(|name| Package::find(name).ok()) {
        Some(mpi) => flags += &mpi.ask(&["--libs", "--keep-system-libs"])?,
        None => flags += &flags_of_mpicc()?,
    }
    link(&flags);
    Ok(())
}

/// The directory of `PETSc.pc` for the PETSc that the environment variables choose.
fn chosen() -> Option<PathBuf> {
    let directory = std::env::var_os("PETSC_DIR")?;
    let architecture = std::env::var_os("PETSC_ARCH").unwrap_or_default();
    Some(Path::new(&directory).join(architecture).join("lib/pkgconfig"))
}

/// A package that pkg-config knows.
struct Package {
    name: String,
}

impl Package {
    fn find(name: &str) -> Result<Package, String> {
        let package = Package { name: name.into() };
        package.ask(&["--exists", "--print-errors"])?;
        Ok(package)
    }

    fn ask(&self, options: &[&str]) -> Result<String, String> {
        let mut command = Command::new("pkg-config");
        if let Some(directory) = chosen() {
            let mut path = directory.into_os_string();
            if let Some(further) = std::env::var_os("PKG_CONFIG_PATH") {
                path.push(":");
                path.push(further);
            }
            command.env("PKG_CONFIG_PATH", path);
        }
        let output = command.args(options).arg(&self.name).output();
        let output = output.map_err(|error| format!("pkg-config: {error}"))?;
        if !output.status.success() {
            let text = String::from_utf8_lossy(&output.stderr);
            return Err(text.split_whitespace().collect::<Vec<_>>().join(" "));
        }
        Ok(String::from_utf8_lossy(&output.stdout).into_owned())
    }

    /// The path of a header.
    fn header(&self, name: &str) -> Result<PathBuf, String> {
        let flags = self.ask(&["--cflags-only-I", "--keep-system-cflags"])?;
        let directories = flags.split_whitespace().filter_map(|flag| flag.strip_prefix("-I"));
        let mut paths = directories.map(|directory| Path::new(directory).join(name));
        paths.find(|path| path.exists()).ok_or_else(|| format!("{name} is missing"))
    }
}

/// Passes linker flags on. The tests of this crate also search the library directories when they start; the build
/// scripts of other packages receive these directories in the variable `DEP_MPM_PETSC_DIRECTORIES`.
fn link(flags: &str) {
    let mut directories = Vec::new();
    for flag in flags.split_whitespace() {
        if let Some(directory) = flag.strip_prefix("-L") {
            println!("cargo::rustc-link-search=native={directory}");
            println!("cargo::rustc-link-arg=-Wl,-rpath,{directory}");
            directories.push(directory);
        } else if let Some(library) = flag.strip_prefix("-l") {
            println!("cargo::rustc-link-lib=dylib={library}");
        }
    }
    println!("cargo::metadata=directories={}", directories.join(":"));
}

/// Asks the MPI compiler for the libraries, on a machine where pkg-config knows no MPI package.
fn flags_of_mpicc() -> Result<String, String> {
    for option in ["--showme:link", "-link_info"] {
        let output = Command::new("mpicc").arg(option).output();
        let output = output.map_err(|error| format!("neither pkg-config nor mpicc finds MPI: {error}"))?;
        if output.status.success() {
            return Ok(format!(" {}", String::from_utf8_lossy(&output.stdout)));
        }
    }
    Err("mpicc does not name its libraries".into())
}
