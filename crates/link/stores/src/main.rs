//! What a slot of a centre costs with its state in a file, in `redb` and in `fjall`: processor time, elapsed time, bytes handed to the system.
//!
//! ```text
//! cd crates/link/stores && cargo run --release [SENSORS] [SLOTS]
//! ```
//! A state is an entry of 100 bytes of each sensor (what the link keeps of it), an entry of 300 bytes of each sensor (what the estimator
//! keeps) and 1000 bytes for the rest. In a slot some sensors change, then the state is stored; when the next begins, two numbers are. All
//! variants survive the end of the process; those called durable wait for the disk too. The machine's own files say what was used: Linux.

use fjall::{Config, PartitionCreateOptions, PersistMode};
use redb::{Database, ReadableDatabase, TableDefinition};
use std::error::Error;
use std::fs::File;
use std::io::Write;
use std::path::Path;
use std::time::Instant;

const LINK: usize = 100;
const ESTIMATOR: usize = 300;
const REST: usize = 1000;
const TABLE: TableDefinition<u32, &[u8]> = TableDefinition::new("state");

type Outcome<T> = Result<T, Box<dyn Error>>;

/// The state of all sensors, and which of them changed.
struct State {
    entries: Vec<Vec<u8>>,
    rest: Vec<u8>,
    changed: Vec<u32>,
}

impl State {
    fn new(sensors: usize) -> Self {
        let entry = |i: usize| (0..LINK + ESTIMATOR).map(|k| (i * 31 + k * 7) as u8).collect();
        Self {
            entries: (0..sensors).map(entry).collect(),
            rest: vec![3; REST],
            changed: Vec::new(),
        }
    }

    fn pass(&mut self, slot: u64, changes: usize) {
        self.changed.clear();
        let count = self.entries.len();
        for k in 0..changes {
            let place = if changes == count {
                k
            } else {
                (slot as usize * 7919 + k * 104_729) % count
            };
            self.entries[place][..8].copy_from_slice(&slot.to_be_bytes());
            self.changed.push(place as u32);
        }
        self.changed.sort_unstable();
        self.changed.dedup();
        self.rest[..8].copy_from_slice(&slot.to_be_bytes());
    }
}

trait Kept {
    /// The state after an update.
    fn store(&mut self, state: &State) -> Outcome<()>;
    /// That a slot begins.
    fn begin(&mut self, slot: u64, state: &State) -> Outcome<()>;
}

/// A file that replaces the last one; `small` has the beginning of a slot in a file of its own.
struct Files<'a> {
    folder: &'a Path,
    durable: bool,
    small: bool,
}

impl Files<'_> {
    fn replace(&self, name: &str, bytes: &[u8]) -> Outcome<()> {
        let (beside, path) = (self.folder.join("new"), self.folder.join(name));
        let mut file = File::create(&beside)?;
        file.write_all(bytes)?;
        if self.durable {
            file.sync_all()?;
        }
        std::fs::rename(&beside, &path)?;
        if self.durable {
            File::open(self.folder)?.sync_all()?;
        }
        Ok(())
    }
}

impl Kept for Files<'_> {
    fn store(&mut self, state: &State) -> Outcome<()> {
        let mut bytes = Vec::with_capacity(state.entries.len() * (LINK + ESTIMATOR) + REST);
        state.entries.iter().for_each(|entry| bytes.extend(entry));
        bytes.extend(&state.rest);
        self.replace("state", &bytes)
    }

    fn begin(&mut self, slot: u64, state: &State) -> Outcome<()> {
        match self.small {
            true => self.replace("slot", &slot.to_be_bytes()),
            false => self.store(state),
        }
    }
}

/// Every commit waits for the disk: one that does not is lost with the process.
struct Redb(Database);

impl Kept for Redb {
    fn store(&mut self, state: &State) -> Outcome<()> {
        let write = self.0.begin_write()?;
        {
            let mut table = write.open_table(TABLE)?;
            for place in &state.changed {
                table.insert(place, state.entries[*place as usize].as_slice())?;
            }
            table.insert(u32::MAX, state.rest.as_slice())?;
        }
        Ok(write.commit()?)
    }

    fn begin(&mut self, slot: u64, _: &State) -> Outcome<()> {
        let write = self.0.begin_write()?;
        write
            .open_table(TABLE)?
            .insert(u32::MAX - 1, slot.to_be_bytes().as_slice())?;
        Ok(write.commit()?)
    }
}

struct Fjall {
    keyspace: fjall::Keyspace,
    table: fjall::PartitionHandle,
    mode: PersistMode,
}

impl Kept for Fjall {
    fn store(&mut self, state: &State) -> Outcome<()> {
        let mut batch = self.keyspace.batch();
        for place in &state.changed {
            batch.insert(&self.table, place.to_be_bytes(), &state.entries[*place as usize]);
        }
        batch.insert(&self.table, u32::MAX.to_be_bytes(), &state.rest);
        batch.commit()?;
        Ok(self.keyspace.persist(self.mode)?)
    }

    fn begin(&mut self, slot: u64, _: &State) -> Outcome<()> {
        self.table.insert((u32::MAX - 1).to_be_bytes(), slot.to_be_bytes())?;
        Ok(self.keyspace.persist(self.mode)?)
    }
}

/// Processor seconds of this process, and bytes that it handed to the system.
fn used() -> Outcome<(f64, f64)> {
    let stat = std::fs::read_to_string("/proc/self/stat")?;
    let cells: Vec<&str> = stat.rsplit(')').next().unwrap_or_default().split_whitespace().collect();
    let ticks = cells[11].parse::<f64>()? + cells[12].parse::<f64>()?;
    let io = std::fs::read_to_string("/proc/self/io")?;
    let bytes = io.lines().find_map(|line| line.strip_prefix("wchar: ")).unwrap_or("0");
    Ok((ticks / 100.0, bytes.trim().parse()?))
}

fn size(folder: &Path) -> u64 {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let of = |entry: std::fs::DirEntry| match entry.metadata() {
        Ok(metadata) if metadata.is_dir() => size(&entry.path()),
        Ok(metadata) => metadata.len(),
        Err(_) => 0,
    };
    entries.map(of).sum()
}

fn main() -> Outcome<()> {
    let mut words = std::env::args().skip(1);
    let sensors: usize = words.next().map_or(Ok(25_000), |word| word.parse())?;
    let slots: u64 = words.next().map_or(Ok(30), |word| word.parse())?;
    println!("{sensors} sensors, {slots} slots; per slot: processor ms, elapsed ms, MB written; at the end MB on disk");
    for changes in [sensors, sensors / 10, sensors / 100] {
        let names = [
            "file",
            "file, small begin",
            "fjall",
            "file, durable",
            "file, small begin, durable",
            "redb, durable",
            "fjall, durable",
        ];
        for (place, name) in names.iter().enumerate() {
            let folder = tempfile::tempdir_in(".")?;
            let path = folder.path();
            let files = |durable, small| -> Box<dyn Kept> {
                Box::new(Files {
                    folder: Box::leak(Box::new(path.to_owned())),
                    durable,
                    small,
                })
            };
            let fjall = |mode| -> Outcome<Box<dyn Kept>> {
                let keyspace = Config::new(path).open()?;
                let table = keyspace.open_partition("state", PartitionCreateOptions::default())?;
                Ok(Box::new(Fjall { keyspace, table, mode }))
            };
            let mut kept = match place {
                0 => files(false, false),
                1 => files(false, true),
                2 => fjall(PersistMode::Buffer)?,
                3 => files(true, false),
                4 => files(true, true),
                5 => Box::new(Redb(Database::create(path.join("redb"))?)),
                _ => fjall(PersistMode::SyncAll)?,
            };
            let mut state = State::new(sensors);
            state.pass(0, sensors);
            kept.store(&state)?;
            let ((processor, bytes), start) = (used()?, Instant::now());
            for slot in 1..=slots {
                kept.begin(slot, &state)?;
                state.pass(slot, changes);
                kept.store(&state)?;
            }
            let elapsed = start.elapsed().as_secs_f64();
            let after = used()?;
            let per = |sum: f64| sum / slots as f64;
            println!(
                "{changes:6} changed  {name:27} {:7.1} {:8.1} {:8.2} {:8.1}",
                1e3 * per(after.0 - processor),
                1e3 * per(elapsed),
                per(after.1 - bytes) / 1e6,
                size(path) as f64 / 1e6
            );
        }
    }
    // What was written is there.
    let folder = tempfile::tempdir_in(".")?;
    let mut kept = Redb(Database::create(folder.path().join("redb"))?);
    let mut state = State::new(10);
    state.pass(7, 10);
    kept.store(&state)?;
    let table = kept.0.begin_read()?.open_table(TABLE)?;
    let found = redb::ReadableTable::get(&table, 3)?.map(|entry| entry.value() == state.entries[3]);
    assert_eq!(found, Some(true));
    Ok(())
}
