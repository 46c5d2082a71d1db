//! What an experiment ran on.

use std::fmt;

use crate::pool::cores;
use crate::simd::Simd;

/// The machine and the build.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Machine {
    /// The processor's name.
    pub processor: String,
    /// The cores that this process may use.
    pub cores: usize,
    /// The operating system.
    pub system: &'static str,
    /// The instruction set that the program was built for.
    pub architecture: &'static str,
    /// The vector instructions that the kernels use.
    pub instructions: &'static str,
}

impl Machine {
    /// This machine.
    #[must_use]
    pub fn this() -> Self {
        Self {
            processor: processor().unwrap_or_else(|| "unknown processor".to_owned()),
            cores: cores(),
            system: std::env::consts::OS,
            architecture: std::env::consts::ARCH,
            instructions: Simd::detect().instructions().name(),
        }
    }
}

impl fmt::Display for Machine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { processor, cores, system, architecture, instructions } = self;
        let plural = if *cores == 1 { "" } else { "s" };
        write!(
            f,
            "{processor}, {cores} core{plural}, {system} {architecture}, kernels {instructions}"
        )
    }
}

/// What Linux says of the processor; other systems are not asked.
fn processor() -> Option<String> {
    let text = std::fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("model name"))?;
    let (_, name) = line.split_once(':')?;
    Some(name.trim().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_has_a_core() {
        let machine = Machine::this();
        assert!(machine.cores >= 1);
        assert!(machine.to_string().contains(machine.architecture));
    }
}
