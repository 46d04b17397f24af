//! Orderly exits at the limits of the system: when memory runs out, or a file reaches its largest size.
//!
//! A failed allocation ends a Rust program with SIGABRT, and the allocation cannot be retried. A thread that needs no
//! memory waits for that signal, prints a message and exits with the code of a failed analysis. Meanwhile the thread
//! that asked for memory must not continue: the signal handler ends with a write to a full pipe, which blocks.

#[cfg(unix)]
pub use unix::{limits_are_errors, wait_for_lack_of_memory};

/// Does nothing: other systems raise no signal when a file reaches its largest size.
///
/// # Errors
/// None.
#[cfg(not(unix))]
pub fn limits_are_errors() -> anyhow::Result<()> {
    Ok(())
}

/// On other systems, a failed allocation ends the program with Rust's own message.
///
/// # Errors
/// None.
#[cfg(not(unix))]
pub fn wait_for_lack_of_memory() -> anyhow::Result<()> {
    Ok(())
}

#[cfg(unix)]
mod unix {
    use std::io::{self, PipeReader, Read, Write};
    use std::os::fd::OwnedFd;
    use std::os::unix::net::UnixStream;
    use std::sync::Arc;
    use std::sync::atomic::AtomicBool;
    use std::{panic, process};

    use anyhow::Context;
    use signal_hook::consts::{SIGABRT, SIGXFSZ};
    use signal_hook::low_level::{self, pipe};

    use crate::program::exit::FAILED;

    const NO_MEMORY: &[u8] = b"error[S008]: not enough memory: the system refused an allocation\n  results up \
        to the last equilibrated step are in the results directory\n  help: use larger cells or fewer points, run on a machine \
        with more memory, or raise `ulimit -v`\n";

    /// Part of the panic message of zlib-rs when it runs out of memory.
    const ZLIB_WITHOUT_MEMORY: &str = "left: MemError";

    /// Stack of the waiting thread, [byte].
    const STACK: usize = 64 << 10;

    /// Makes a write beyond the file size limit, `ulimit -f`, an ordinary error, like a full disk.
    ///
    /// # Errors
    /// If the signal cannot be handled.
    pub fn limits_are_errors() -> anyhow::Result<()> {
        // With the signal handled, the write that caused it returns an error.
        signal_hook::flag::register(SIGXFSZ, Arc::new(AtomicBool::new(false)))
            .context("the signal SIGXFSZ cannot be handled")?;
        Ok(())
    }

    /// Makes a failed allocation end the program with a message and the exit code of a failed analysis.
    ///
    /// # Errors
    /// If the signal cannot be handled or the thread that waits for it cannot be started.
    pub fn wait_for_lack_of_memory() -> anyhow::Result<()> {
        let (mut awaited, waker) = UnixStream::pair().context("no sockets can be created")?;
        pipe::register(SIGABRT, waker).context("failed allocations cannot be handled")?;
        let reader = block_on_abort().context("failed allocations cannot be handled")?;
        std::thread::Builder::new()
            .name("out of memory".to_owned())
            .stack_size(STACK)
            .spawn(move || {
                let mut byte = [0];
                if awaited.read_exact(&mut byte).is_ok() {
                    let _ = io::stderr().write_all(NO_MEMORY);
                    low_level::exit(i32::from(FAILED));
                }
                drop(reader);
            })
            .context("the threads cannot be started")?;
        let otherwise = panic::take_hook();
        panic::set_hook(Box::new(move |panic| {
            // The compression library panics when an allocation fails.
            if panic.payload().downcast_ref::<String>().is_some_and(|text| text.contains(ZLIB_WITHOUT_MEMORY))
            {
                process::abort();
            }
            otherwise(panic);
        }));
        Ok(())
    }

    /// Makes the handler of SIGABRT block until someone reads from the returned pipe.
    fn block_on_abort() -> io::Result<PipeReader> {
        let (reader, writer) = io::pipe()?;
        let mut same = writer.try_clone()?;
        let switch = UnixStream::from(OwnedFd::from(writer.try_clone()?));
        // Registering makes the pipe non-blocking: a write to the full pipe returns an error ...
        pipe::register(SIGABRT, writer)?;
        while same.write(&[0; 4096]).is_ok() {}
        while same.write(&[0]).is_ok() {}
        // ... until it is made blocking again.
        switch.set_nonblocking(false)?;
        Ok(reader)
    }
}
