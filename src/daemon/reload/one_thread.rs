//! Parallel work on one thread. In: a computation. Out: its result. Thread: show-file and a new one.

/// Calls `compute` with parallel work on one thread, because the show and the sound need the other
/// processors.
///
/// # Errors
/// The operating system cannot start a thread.
pub(super) fn on_one_thread<T: Send>(
    compute: impl FnOnce() -> T + Send,
) -> Result<T, rayon::ThreadPoolBuildError> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    Ok(pool.install(compute))
}
