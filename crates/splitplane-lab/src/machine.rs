//! What is known of the machine that measures.

use serde::{Deserialize, Serialize};
use sysinfo::{CpuRefreshKind, RefreshKind, System};

/// The machine, and how busy it is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Machine {
    /// The processor, by its maker's name; "unknown" where the system does not say.
    pub cpu: String,
    /// Logical processors that this process may use.
    pub cores: usize,
    /// Processes that ran or waited, averaged over the last minute; `None` where the system does
    /// not say.
    pub load_1m: Option<f64>,
    /// The operating system and its version.
    pub os: String,
}

impl Machine {
    /// This machine, now.
    pub fn now() -> Machine {
        let unknown = || "unknown".to_owned();
        let cpu =
            System::new_with_specifics(RefreshKind::nothing().with_cpu(CpuRefreshKind::nothing()))
                .ok()
                .and_then(|system| Some(system.cpus().first()?.brand().trim().to_owned()))
                .filter(|brand| !brand.is_empty());
        Machine {
            cpu: cpu.unwrap_or_else(unknown),
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            load_1m: System::load_average().ok().map(|load| load.one),
            os: System::long_os_version().unwrap_or_else(|_| unknown()),
        }
    }

    /// Whether others kept the machine so busy that times on it mean little: more than a quarter
    /// of its processors were in use before the measurement.
    pub fn is_busy(&self) -> bool {
        self.load_1m
            .is_some_and(|load| load > 0.25 * self.cores as f64)
    }
}

/// The most memory that this process has held so far, in bytes; `None` where the system does not
/// say (it does on Linux).
pub fn peak_memory_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_machine_has_a_core_and_a_name_for_everything() {
        let machine = Machine::now();
        assert!(machine.cores >= 1);
        assert!(!machine.cpu.is_empty() && !machine.os.is_empty());
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn the_peak_of_memory_is_more_than_a_large_allocation() {
        let block = vec![1_u8; 64 << 20];
        assert!(peak_memory_bytes().unwrap() > block.len() as u64);
    }
}
