//! Tiled image in a folder that several processes may fill: an uncompressed Zarr v3 array
//! (zarr-specs.readthedocs.io), readable by any Zarr reader.
//!
//! | file | content |
//! |---|---|
//! | `zarr.json` | shape of the array, `complex64`, one chunk per tile |
//! | `c/R/C` | tile of row `R` and column `C` of tiles: little-endian, row-major; tiles at the edges are padded with zeros |
//! | `plan.json` | plan by which tiles are formed, a text of the store's creator |
//! | `done/R.C.json` | mark of a complete tile: its CRC-32, and notes of its creator |
//!
//! **Atomic writes.** A tile, then its mark, is written to a hidden file, synced and renamed: a tile with a mark is
//! complete even if a process was killed. The store's folder is also created under a hidden name and renamed, so that
//! every store has a plan. If two processes write the same tile, either one remains; tiles by the same plan are
//! bit-identical.
//!
//! **Limits**: no memory is sized by the array's metadata. Tiles are counted by their marks, and memory depends on
//! the part that is read.

mod array;
mod read;

use std::collections::{BTreeMap, HashMap};
use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{SystemTime, UNIX_EPOCH};

use num_complex::Complex32;
use serde::Deserialize;
use serde_json::{Value, json};

use self::array::{Array, tile_bytes};
use super::ReadError;
use super::atomic::{WriteError, check_room, put_in_place, sync_folder};
use super::input::{Stamp, open_file};
use super::json::{self, JsonError, Limits};
use super::lock::Lock;
use super::place::OutputPlace;
use super::unfinished::{self, Unfinished};
use subaperture_model::image::Tiling;

/// Name of the store's folder in a product.
pub const NAME: &str = "image.zarr";

const ARRAY: &str = "zarr.json";
const PLAN: &str = "plan.json";
const CHUNKS: &str = "c";
const MARKS: &str = "done";

/// Limits on a plan; a surface is a string of up to 3.5 MB.
pub const PLAN_LIMITS: Limits = Limits {
    bytes: 6 << 20,
    string_bytes: 4 << 20,
    value_bytes: 5 << 20,
};

/// Limits on a mark; the notes on a tile take some kilobytes.
const MARK_LIMITS: Limits = Limits {
    bytes: 1 << 20,
    string_bytes: 1 << 12,
    value_bytes: 1 << 20,
};

/// Size of all tiles on disk, bytes.
pub fn disk_bytes(tiling: &Tiling) -> u64 {
    (tiling.count() as u64).saturating_mul(tile_bytes(tiling))
}

/// Error of reading a store.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StoreError {
    /// A file cannot be read, or does not belong to a store.
    #[error(transparent)]
    File(#[from] ReadError),
    /// A tile differs from its mark.
    #[error("{}: {what}", path.display())]
    Damaged {
        /// Path of the tile.
        path: PathBuf,
        /// Path of the mark. Without it the tile is formed again.
        mark: PathBuf,
        /// Difference found.
        what: String,
    },
}

/// Store of tiles in a folder.
#[derive(Debug)]
pub struct TileStore {
    folder: PathBuf,
    tiling: Tiling,
    plan: String,
    /// Tiles whose CRC-32 was verified, with the state of their files at that time.
    verified: Mutex<HashMap<usize, Stamp>>,
    /// Lock that distinguishes the hidden files of this process from those of killed ones. Created with the first
    /// tile.
    writer: Mutex<Option<OutputPlace>>,
}

impl TileStore {
    /// Create an empty store in the folder `product`, which is created if missing.
    ///
    /// # Errors
    /// [`WriteError`], also if a store exists or the disk has no room for all tiles.
    pub fn create(product: &Path, tiling: Tiling, plan: &str) -> Result<Self, WriteError> {
        let folder = product.join(NAME);
        let failed = |source: io::Error| WriteError::Io {
            path: folder.clone(),
            needed_bytes: disk_bytes(&tiling),
            source,
        };
        fs::create_dir_all(product).map_err(failed)?;
        check_room(&folder, product, disk_bytes(&tiling))?;
        let place = OutputPlace::of_folder(&folder)?;
        let beside = product.join(place.lock.hidden_name(".zarr"));
        fs::create_dir(&beside).map_err(failed)?;
        unfinished::begin(Unfinished::Folder(beside.clone()));
        let made = Self::fill(&beside, tiling, plan).and_then(|()| {
            let _moving = unfinished::commit();
            fs::rename(&beside, &folder)?;
            sync_folder(product)
        });
        let _ = fs::remove_dir_all(&beside);
        unfinished::end(&beside);
        made.map_err(failed)?;
        Ok(Self::of(folder, tiling, plan.to_owned()))
    }

    fn of(folder: PathBuf, tiling: Tiling, plan: String) -> Self {
        Self {
            folder,
            tiling,
            plan,
            verified: Mutex::default(),
            writer: Mutex::default(),
        }
    }

    /// Remove the store in the folder `product`, complete or not, if any. Atomic even if the process is killed.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn discard(product: &Path) -> Result<(), WriteError> {
        let folder = product.join(NAME);
        if !folder.exists() {
            return Ok(());
        }
        let place = OutputPlace::of_folder(&folder)?;
        let old = product.join(place.lock.hidden_name(".old"));
        let moved = fs::rename(&folder, &old).and_then(|()| {
            unfinished::begin(Unfinished::Folder(old.clone()));
            let removed = fs::remove_dir_all(&old);
            unfinished::end(&old);
            removed
        });
        moved.map_err(|source| WriteError::Io {
            path: folder,
            needed_bytes: 0,
            source,
        })
    }

    fn fill(folder: &Path, tiling: Tiling, plan: &str) -> io::Result<()> {
        fs::create_dir(folder.join(CHUNKS))?;
        fs::create_dir(folder.join(MARKS))?;
        for row in 0..tiling.tiles()[0] {
            fs::create_dir(folder.join(CHUNKS).join(row.to_string()))?;
        }
        let array = array::describe(&tiling);
        let text = serde_json::to_string_pretty(&array)? + "\n";
        for (name, text) in [(PLAN, plan), (ARRAY, text.as_str())] {
            let mut file = File::create_new(folder.join(name))?;
            file.write_all(text.as_bytes())?;
            file.sync_all()?;
        }
        sync_folder(folder)
    }

    /// Open the store in the folder `product`. `None` if there is no store.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn open(product: &Path) -> Result<Option<Self>, StoreError> {
        let folder = product.join(NAME);
        let path = folder.join(ARRAY);
        if !path.exists() {
            return Ok(None);
        }
        let array: Result<Array, _> = json::typed(open(&path)?, array::LIMITS);
        let tiling = match array {
            Ok(array) => array.tiling(),
            Err(JsonError::Io(source)) => return Err(ReadError::Io { path, source }.into()),
            Err(error) => Err(error.to_string()),
        };
        let tiling = tiling.map_err(|what| ReadError::Malformed {
            path,
            what: format!("not an image of complex64 in uncompressed tiles: {what}"),
        })?;
        let plan = read_plan(&folder.join(PLAN))?;
        Ok(Some(Self::of(folder, tiling, plan)))
    }

    /// Sizes of the image and of its tiles.
    pub fn tiling(&self) -> Tiling {
        self.tiling
    }

    /// Text of the plan.
    pub fn plan(&self) -> &str {
        &self.plan
    }

    /// Folder of the store.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Lock the part `part` of the work against other processes until the result is dropped.
    ///
    /// # Errors
    /// [`WriteError`] if another process holds the lock.
    pub fn claim(&self, part: &str) -> Result<Claimed, WriteError> {
        let place = OutputPlace::of_file(&self.folder.join(format!("part {part}")))?;
        Ok(Claimed {
            _lock: place.lock.clone(),
            _place: place,
        })
    }

    fn chunk(&self, index: usize) -> PathBuf {
        let [row, column] = self.tiling.at(index);
        let row = self.folder.join(CHUNKS).join(row.to_string());
        row.join(column.to_string())
    }

    fn mark(&self, index: usize) -> PathBuf {
        let name = mark_name(self.tiling.at(index));
        self.folder.join(MARKS).join(name)
    }

    /// Write a tile, row-major, with a `note` in its mark.
    ///
    /// # Errors
    /// [`WriteError`]; the tile is then unchanged.
    ///
    /// # Panics
    /// Panics if `index` is out of range or the number of pixels differs from that of the tile.
    pub fn put(&self, index: usize, pixels: &[Complex32], note: &Value) -> Result<(), WriteError> {
        let [rows, columns] = self.tiling.place(index);
        assert_eq!(pixels.len(), rows.len() * columns.len());
        let mut crc = crc32fast::Hasher::new();
        let mut row_bytes = vec![0; 8 * self.tiling.tile[1]];
        self.beside(&self.chunk(index), |out| {
            for row in 0..self.tiling.tile[0] {
                let first = row * columns.len();
                let values = pixels.get(first..first + columns.len()).unwrap_or(&[]);
                row_bytes.fill(0);
                for (bytes, z) in row_bytes.chunks_exact_mut(8).zip(values) {
                    bytes[..4].copy_from_slice(&z.re.to_le_bytes());
                    bytes[4..].copy_from_slice(&z.im.to_le_bytes());
                }
                crc.update(&row_bytes);
                out.write_all(&row_bytes)?;
            }
            Ok(())
        })?;
        let mark = json!({
            "crc32": format!("{:08x}", crc.finalize()),
            "note": note,
        });
        self.beside(&self.mark(index), |out| {
            serde_json::to_writer(&mut *out, &mark)?;
            out.write_all(b"\n")
        })
    }

    /// Indices of the complete tiles by their marks, ascending. Their number is that of the files, independent of the
    /// metadata.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn present(&self) -> Result<Vec<usize>, StoreError> {
        let path = self.folder.join(MARKS);
        let failed = |source| ReadError::Io {
            path: path.clone(),
            source,
        };
        let mut present = Vec::new();
        for entry in fs::read_dir(&path).map_err(failed)? {
            let name = entry.map_err(failed)?.file_name();
            present.extend(name.to_str().and_then(|name| self.index_of_mark(name)));
        }
        present.sort_unstable();
        Ok(present)
    }

    /// Tile whose mark has this name. `None` for any other file.
    fn index_of_mark(&self, name: &str) -> Option<usize> {
        let (row, column) = name.strip_suffix(".json")?.split_once('.')?;
        let [down, across] = self.tiling.tiles();
        let (row, column) = (row.parse().ok()?, column.parse().ok()?);
        let within = row < down && column < across;
        let index = within.then(|| row * across + column)?;
        // Names with the same numbers in another spelling are not marks.
        (mark_name([row, column]) == name).then_some(index)
    }

    /// Complete tiles with their notes.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn done(&self) -> Result<BTreeMap<usize, Value>, StoreError> {
        #[derive(Deserialize)]
        struct Noted {
            #[serde(default)]
            note: Value,
        }
        let each = self.present()?.into_iter();
        each.map(|index| Ok((index, self.read_mark::<Noted>(index)?.note)))
            .collect()
    }

    /// Whether a tile is complete, by its mark.
    ///
    /// # Panics
    /// Panics if there is no such tile.
    pub fn has(&self, index: usize) -> bool {
        self.mark(index).exists()
    }

    fn verified(&self) -> MutexGuard<'_, HashMap<usize, Stamp>> {
        self.verified.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Write a file under a hidden name, sync and rename it. Its folder belongs to the store, and the name is not a
    /// link.
    ///
    /// The hidden file is in the store's folder, under the name of a lock of this process. If this process is killed,
    /// the next one that takes a lock there removes the file.
    fn beside(
        &self,
        path: &Path,
        write: impl FnOnce(&mut io::BufWriter<&mut File>) -> io::Result<()>,
    ) -> Result<(), WriteError> {
        let hidden = self.folder.join(self.hidden_name()?);
        unfinished::begin(Unfinished::File(hidden.clone()));
        let written = (|| {
            let mut file = File::create_new(&hidden)?;
            let mut out = io::BufWriter::with_capacity(1 << 16, &mut file);
            write(&mut out)?;
            out.flush()?;
            drop(out);
            put_in_place(&file, &hidden, path)
        })();
        let _ = fs::remove_file(&hidden);
        unfinished::end(&hidden);
        written.map_err(|source| WriteError::Io {
            path: path.to_owned(),
            needed_bytes: 0,
            source,
        })
    }

    fn hidden_name(&self) -> Result<String, WriteError> {
        let mut writer = self.writer.lock().unwrap_or_else(PoisonError::into_inner);
        let place = match writer.take() {
            Some(place) => place,
            None => {
                // Processes on two machines or in two containers can have the same number.
                let since = SystemTime::now().duration_since(UNIX_EPOCH);
                let moment = since.unwrap_or_default().as_nanos();
                let name = format!("writer {} {moment}", std::process::id());
                OutputPlace::of_file(&self.folder.join(name))?
            }
        };
        Ok(writer.insert(place).lock.hidden_name(".tile"))
    }
}

fn mark_name([row, column]: [usize; 2]) -> String {
    format!("{row}.{column}.json")
}

/// Lock on a part of a store's work. Released when dropped.
#[derive(Debug)]
pub struct Claimed {
    _lock: Arc<Lock>,
    _place: OutputPlace,
}

fn open(path: &Path) -> Result<File, ReadError> {
    open_file(path).map_err(ReadError::io(path))
}

fn read_plan(path: &Path) -> Result<String, ReadError> {
    let mut text = String::new();
    let read = open(path)?
        .take(PLAN_LIMITS.bytes + 1)
        .read_to_string(&mut text);
    match read {
        Ok(count) if count as u64 > PLAN_LIMITS.bytes => Err(ReadError::malformed(
            path,
            format!(
                "expected a plan of at most {} bytes, found more",
                PLAN_LIMITS.bytes
            ),
        )),
        Ok(_) => Ok(text),
        Err(source) => Err(ReadError::io(path)(source)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use subaperture_model::image::ImageSource;

    const TILING: Tiling = Tiling {
        image: [5, 7],
        tile: [2, 3],
    };

    fn tile(index: usize) -> Vec<Complex32> {
        let [rows, columns] = TILING.place(index);
        let value = |(r, c): (usize, usize)| Complex32::new(r as f32, c as f32 + 0.5);
        rows.flat_map(|r| columns.clone().map(move |c| (r, c)))
            .map(value)
            .collect()
    }

    #[test]
    fn tiles_read_back_and_damage_is_detected() {
        let folder = tempfile::tempdir().unwrap();
        let product = folder.path().join("a/b");
        assert!(TileStore::open(&product).unwrap().is_none());
        let store = TileStore::create(&product, TILING, "the plan").unwrap();
        assert_eq!(TILING.tiles(), [3, 3]);
        for index in [8, 0, 5] {
            store
                .put(index, &tile(index), &json!({ "n": index }))
                .unwrap();
        }
        let again = TileStore::open(&product).unwrap().unwrap();
        assert_eq!((again.tiling(), again.plan()), (TILING, "the plan"));
        let done: Vec<usize> = again.done().unwrap().into_keys().collect();
        assert_eq!(done, [0, 5, 8]);
        assert_eq!(again.done().unwrap()[&5]["n"], 5);
        for index in done {
            assert_eq!(again.read(index).unwrap(), tile(index));
        }
        // Row 2 of tiles is row 4 of the image and a row of padding; column 2 is the image's column 6 and two of
        // padding.
        let bytes = fs::read(product.join("image.zarr/c/2/2")).unwrap();
        assert_eq!(bytes.len(), 8 * 6);
        assert_eq!(bytes[..8], [0, 0, 0x80, 0x40, 0, 0, 0xd0, 0x40]);
        assert!(bytes[8..].iter().all(|&b| b == 0));

        let chunk = product.join("image.zarr/c/0/0");
        let mut bytes = fs::read(&chunk).unwrap();
        bytes[3] ^= 1;
        fs::write(&chunk, bytes).unwrap();
        let error = again.read(0).unwrap_err().to_string();
        assert!(error.contains("CRC-32"), "{error}");
        fs::write(&chunk, [0; 3]).unwrap();
        let error = again.read(0).unwrap_err().to_string();
        assert!(error.contains("expected 48 bytes, found 3"), "{error}");
        // Any window is read from its tiles.
        for index in 0..TILING.count() {
            store.put(index, &tile(index), &Value::Null).unwrap();
        }
        let window = again.window(&[1..5, 2..7]).unwrap();
        assert_eq!((window.rows, window.columns), (4, 5));
        for (i, z) in window.pixels.iter().enumerate() {
            let (row, column) = (1 + i / 5, 2 + i % 5);
            assert_eq!(*z, Complex32::new(row as f32, column as f32 + 0.5));
        }
        // Decimated reads return these rows and columns only, also for tiles at the edges.
        assert!(again.has(3) && again.has(8));
        let glance = again.glance(4, [1, 0], [2, 2]).unwrap();
        assert_eq!((glance.rows, glance.columns), (1, 2));
        let expected = [Complex32::new(3.0, 3.5), Complex32::new(3.0, 5.5)];
        assert_eq!(glance.pixels, expected);
        let glance = again.glance(8, [0, 0], [3, 3]).unwrap();
        assert_eq!(
            (glance.rows, glance.pixels),
            (1, vec![Complex32::new(4.0, 6.5)])
        );
        // No other file remains.
        let names = fs::read_dir(product.join("image.zarr/c/1")).unwrap();
        assert_eq!(names.count(), 3);
        assert!(TileStore::create(&product, TILING, "").is_err());
    }

    #[test]
    fn invalid_store_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        TileStore::create(folder.path(), TILING, "p").unwrap();
        let path = folder.path().join("image.zarr/zarr.json");
        let text = fs::read_to_string(&path).unwrap();
        for (from, to) in [
            ("complex64", "complex128"),
            ("little", "big"),
            ("7", "0"),
            ("3", "70000000000"),
            ("{", ""),
        ] {
            fs::write(&path, text.replace(from, to)).unwrap();
            let error = TileStore::open(folder.path()).unwrap_err().to_string();
            assert!(error.contains("not an image of complex64"), "{error}");
        }
    }

    /// A killed process leaves an unlocked lock file and partial files.
    #[test]
    fn next_claim_sweeps_tiles_of_killed_processes() {
        let folder = tempfile::tempdir().unwrap();
        let store = TileStore::create(folder.path(), TILING, "p").unwrap();
        let own = folder.path().join(NAME);
        for name in [
            ".subap-0123abcd.lock",
            ".subap-0123abcd-77-0.tile",
            ".subap-0123abcd-77-1.tile",
            ".another",
        ] {
            fs::write(own.join(name), "begun").unwrap();
        }
        store.put(0, &tile(0), &Value::Null).unwrap();
        let claimed = store.claim("1/1").unwrap();
        let names = || -> Vec<String> {
            let all = fs::read_dir(&own).unwrap();
            let mut names: Vec<String> = all
                .map(|entry| entry.unwrap().file_name().into_string().unwrap())
                .filter(|name| name.starts_with('.') && !name.ends_with(".lock"))
                .collect();
            names.sort();
            names
        };
        assert_eq!(names(), [".another"]);
        // Files of running processes are not removed.
        let other = TileStore::open(folder.path()).unwrap().unwrap();
        other.put(5, &tile(5), &Value::Null).unwrap();
        store.put(8, &tile(8), &Value::Null).unwrap();
        assert_eq!(store.present().unwrap(), [0, 5, 8]);
        drop((claimed, store, other));
        let locks = fs::read_dir(&own).unwrap().filter(|entry| {
            let name = entry.as_ref().unwrap().file_name();
            name.to_string_lossy().ends_with(".lock")
        });
        assert_eq!(locks.count(), 0);
    }

    #[test]
    fn part_can_be_claimed_once() {
        let folder = tempfile::tempdir().unwrap();
        let store = TileStore::create(folder.path(), TILING, "p").unwrap();
        let claimed = store.claim("1/8").unwrap();
        drop(claimed);
        store.claim("1/8").unwrap();
    }
}
