//! Orderly exits at the limits of the system: when memory runs out, when code of a library aborts, or when a file
//! reaches its largest size.
//!
//! A failed allocation ends a Rust program with SIGABRT, and the allocation cannot be retried; `abort` in a library
//! does the same. A thread that needs no memory waits for that signal, prints a message and exits with the code of a
//! failed analysis. Meanwhile the thread that aborts must not continue: the signal handler ends with a write to a full
//! pipe, which blocks.

#[cfg(unix)]
pub use unix::{limits_are_errors, wait_for_abort};

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
pub fn wait_for_abort() -> anyhow::Result<()> {
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
    use crate::program::heap;

    const NO_MEMORY: &[u8] = b"error[S008]: not enough memory: the system refused an allocation\n  results up \
        to the last equilibrated step are in the results directory\n  help: use larger cells or fewer points, run on a machine \
        with more memory, or raise `ulimit -v`\n";

    const ABORTED: &[u8] = b"error: the program was aborted (SIGABRT), although no request for memory was refused\n  \
        results up to the last equilibrated step are in the results directory\n  help: if the deck has a law of a library \
        or calls other libraries, look there for `abort` or a failed assertion, for example with a debugger; if not, \
        report this as a fault of the program\n";

    /// Part of the panic message of zlib-rs when it runs out of memory.
    const ZLIB_WITHOUT_MEMORY: &str = "left: MemError";

    /// Part of the panic message of the standard library if the memory does not suffice for another thread.
    const THREAD_WITHOUT_MEMORY: &str = "failed to allocate an alternative stack";

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

    /// Makes a failed allocation, and an abort, end the program with a message and the exit code of a failed analysis.
    ///
    /// # Errors
    /// If the signal cannot be handled or the thread that waits for it cannot be started.
    pub fn wait_for_abort() -> anyhow::Result<()> {
        let (mut awaited, waker) = UnixStream::pair().context("no sockets can be created")?;
        pipe::register(SIGABRT, waker).context("failed allocations cannot be handled")?;
        let reader = block_on_abort().context("failed allocations cannot be handled")?;
        std::thread::Builder::new()
            .name("aborts".to_owned())
            .stack_size(STACK)
            .spawn(move || {
                let mut byte = [0];
                if awaited.read_exact(&mut byte).is_ok() {
                    let _ = io::stderr().write_all(if heap::refused() { NO_MEMORY } else { ABORTED });
                    low_level::exit(i32::from(FAILED));
                }
                drop(reader);
            })
            .context("the threads cannot be started")?;
        let otherwise = panic::take_hook();
        panic::set_hook(Box::new(move |panic| {
            let text = panic.payload().downcast_ref::<String>().map(String::as_str).unwrap_or_default();
            // The compression library panics when an allocation fails.
            let lacks_memory = text.contains(ZLIB_WITHOUT_MEMORY);
            if lacks_memory || text.contains(THREAD_WITHOUT_MEMORY) {
                heap::note_refusal();
            }
            if lacks_memory {
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
