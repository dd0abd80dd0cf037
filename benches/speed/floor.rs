//! The floor of a hop: processes in a ring on nothing but a futex, or a polled word, in shared memory.

use crate::report::Result;
use memmap2::MmapRaw;
use rustix::thread::{CpuSet, futex, sched_setaffinity};
use std::process::{Child, Command};
use std::sync::atomic::{AtomicU32, Ordering::SeqCst};
use std::time::Instant;

const SLOT_BYTES: usize = 64;

/// Nanoseconds per hop of a ring of `cores.len()` processes, each pinned to its core (`None`: to none).
pub fn hop_ns(cores: &[Option<usize>], laps: u32, spin: bool) -> Result<f64> {
    let file = tempfile::NamedTempFile::new_in("/dev/shm")?;
    file.as_file().set_len((SLOT_BYTES * (cores.len() + 1)) as u64)?;
    let path = file.path().to_string_lossy().into_owned();
    let count = cores.len().to_string();
    let start = |(index, core): (usize, &Option<usize>)| -> Result<Child> {
        let core = core.map_or("any".to_owned(), |core| core.to_string());
        let wait = if spin { "spin" } else { "block" };
        Ok(Command::new(std::env::current_exe()?)
            .args(["floor-process", &path, &index.to_string(), &count, &laps.to_string(), &core, wait])
            .spawn()?)
    };
    let mut children = cores.iter().enumerate().map(start).collect::<Result<Vec<_>>>()?;
    let ring = Ring::open(&path, cores.len())?;
    while ring.word(cores.len()).load(SeqCst) < cores.len() as u32 {
        std::thread::yield_now();
    }
    let started = Instant::now();
    ring.pass_on(0, 1, spin);
    for child in &mut children {
        if !child.wait()?.success() {
            return Err("a process of the floor's ring failed".into());
        }
    }
    Ok(started.elapsed().as_nanos() as f64 / f64::from(laps) / cores.len() as f64)
}

/// A process of the ring: waits for its word to reach each lap, then passes the lap on.
pub fn process(args: &[String]) -> Result<()> {
    let [path, index, count, laps, core, wait] = args else { return Err("six arguments".into()) };
    let (index, count, laps): (usize, usize, u32) = (index.parse()?, count.parse()?, laps.parse()?);
    if let Ok(core) = core.parse() {
        let mut set = CpuSet::new();
        set.set(core);
        sched_setaffinity(None, &set)?;
    }
    let ring = Ring::open(path, count)?;
    ring.word(count).fetch_add(1, SeqCst);
    for lap in 1..=laps {
        let spin = wait == "spin";
        ring.await_lap(index, lap, spin);
        let (next, lap) = if index + 1 == count { (0, lap + 1) } else { (index + 1, lap) };
        ring.pass_on(next, lap, spin);
    }
    Ok(())
}

struct Ring {
    map: MmapRaw,
}

impl Ring {
    fn open(path: &str, count: usize) -> Result<Self> {
        let file = std::fs::OpenOptions::new().read(true).write(true).open(path)?;
        let map = MmapRaw::map_raw(&file)?;
        assert!(map.len() >= SLOT_BYTES * (count + 1));
        Ok(Self { map })
    }

    fn word(&self, index: usize) -> &AtomicU32 {
        assert!((index + 1) * SLOT_BYTES <= self.map.len());
        // SAFETY: inside the mapping (asserted), aligned, and only ever accessed as an atomic.
        unsafe { AtomicU32::from_ptr(self.map.as_mut_ptr().add(index * SLOT_BYTES).cast()) }
    }

    fn await_lap(&self, index: usize, lap: u32, spin: bool) {
        let word = self.word(index);
        loop {
            let found = word.load(SeqCst);
            if found >= lap {
                return;
            }
            if spin {
                std::hint::spin_loop();
            } else {
                let _ = futex::wait(word, futex::Flags::empty(), found, None);
            }
        }
    }

    fn pass_on(&self, index: usize, lap: u32, spin: bool) {
        self.word(index).store(lap, SeqCst);
        if spin {
            return;
        }
        let _ = futex::wake(self.word(index), futex::Flags::empty(), 1);
    }
}
