//! Number of threads: from the flag, then the environment, then the machine (and its cgroup quota).

use crate::exit_code::Failure;

/// Runs `work` in a pool of the requested size.
pub(crate) fn with_pool<T: Send>(asked: Option<usize>, work: impl FnOnce() -> T + Send) -> Result<T, Failure> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(count(asked))
        .build()
        .map_err(|e| Failure::Resource(format!("cannot start {} threads: {e}; ask for fewer with -j", count(asked))))?;
    Ok(pool.install(work))
}

/// The number of threads in effect.
pub(crate) fn count(asked: Option<usize>) -> usize {
    let environment = ["RAYON_NUM_THREADS", "SLURM_CPUS_PER_TASK"];
    let named = environment.iter().find_map(|name| std::env::var(name).ok()?.parse::<usize>().ok().filter(|&n| n > 0));
    let machine = || std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    asked.or(named).unwrap_or_else(machine).clamp(1, 1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pool_has_the_asked_size() {
        assert_eq!(with_pool(Some(3), rayon::current_num_threads).unwrap(), 3);
        assert!(count(None) >= 1);
    }
}
