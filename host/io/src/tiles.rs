//! An image kept by tiles in a folder that several processes may fill: a Zarr array of the third version
//! (zarr-specs.readthedocs.io), without compression, so that any reader of Zarr opens it.
//!
//! | file | holds |
//! |---|---|
//! | `zarr.json` | the array's shape, `complex64`, chunks of one tile each |
//! | `c/R/C` | tile of row `R` and column `C` of tiles: little-endian, row-major; tiles at the ends are filled up with zeros |
//! | `plan.json` | by what plan tiles are formed: text that the maker of the store gave |
//! | `done/R.C.json` | that a tile is whole: its CRC-32, and what its maker noted of it |
//!
//! **Complete or absent.** A tile, and its mark after it, is written beside, forced to the disk and renamed: a tile with a mark
//! is whole, whatever was killed when. The folder itself is made beside and renamed, so that a store that is there has a
//! plan. Two processes that write the same tile leave either's; by one plan both are the same to the bit.
//!
//! Memory: a tile.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use num_complex::Complex32;
use serde_json::{Value, json};

use super::atomic::{WriteError, check_room, put_in_place, sync_folder};
use super::lock::Lock;
use super::place::Place as OutputPlace;
use super::unfinished::{self, Thing};
use subaperture_model::image::{Image, Parts, PartsError, Place, Tiling, copy_common};

/// The folder's name in that of a product.
pub const NAME: &str = "image.zarr";

const ARRAY: &str = "zarr.json";
const PLAN: &str = "plan.json";
const CHUNKS: &str = "c";
const MARKS: &str = "done";

/// Longest text that is read: of a plan, a mark or the array's description.
const LONGEST_BYTES: u64 = 256 << 20;

/// Most bytes of a tile.
const LARGEST_TILE_BYTES: u64 = 1 << 32;

/// Bytes that all tiles take on disk.
pub fn disk_bytes(tiling: &Tiling) -> u64 {
    tiling.count() as u64 * tile_bytes(tiling)
}

fn tile_bytes(tiling: &Tiling) -> u64 {
    8 * (tiling.tile[0] as u64) * (tiling.tile[1] as u64)
}

/// What the array's description says of it.
fn tiling_of(array: &Value) -> Option<Tiling> {
    let pair = |value: &Value| {
        let [a, b] = <[Value; 2]>::try_from(value.as_array()?.clone()).ok()?;
        Some([a.as_u64()? as usize, b.as_u64()? as usize])
    };
    let tiling = Tiling {
        image: pair(&array["shape"])?,
        tile: pair(&array["chunk_grid"]["configuration"]["chunk_shape"])?,
    };
    let mut sides = tiling.image.iter().chain(&tiling.tile);
    let possible = sides.all(|&side| (1..=1_000_000_000).contains(&side));
    (possible && tile_bytes(&tiling) <= LARGEST_TILE_BYTES).then_some(tiling)
}

/// Why a store was not read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StoreError {
    /// The operating system refused.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// File concerned.
        path: PathBuf,
        /// Cause.
        source: io::Error,
    },
    /// It is no store of ours.
    #[error("{}: {what}", path.display())]
    Format {
        /// File concerned.
        path: PathBuf,
        /// What is wrong with it.
        what: String,
    },
    /// A tile is not what its mark says.
    #[error("{}: {what}", path.display())]
    Damaged {
        /// The tile.
        path: PathBuf,
        /// Its mark: without that it is formed again.
        mark: PathBuf,
        /// How that shows.
        what: String,
    },
}

/// A store.
#[derive(Debug)]
pub struct TileStore {
    folder: PathBuf,
    tiling: Tiling,
    plan: String,
}

impl TileStore {
    /// Makes an empty store in the folder `product`, which is made if need be.
    ///
    /// # Errors
    /// [`WriteError`], also if there is one already or the disk has no room for all tiles.
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
        unfinished::begin(Thing::Folder(beside.clone()));
        let made = Self::fill(&beside, tiling, plan).and_then(|()| {
            let _moving = unfinished::commit();
            fs::rename(&beside, &folder)?;
            sync_folder(product)
        });
        let _ = fs::remove_dir_all(&beside);
        unfinished::end(&beside);
        made.map_err(failed)?;
        Ok(Self {
            folder,
            tiling,
            plan: plan.to_owned(),
        })
    }

    /// Removes the store in the folder `product`, whole or not, if there is one: at once, whenever the process is ended.
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
            unfinished::begin(Thing::Folder(old.clone()));
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
        let array = json!({
            "zarr_format": 3,
            "node_type": "array",
            "shape": tiling.image,
            "data_type": "complex64",
            "chunk_grid": {
                "name": "regular",
                "configuration": { "chunk_shape": tiling.tile },
            },
            "chunk_key_encoding": { "name": "default", "configuration": { "separator": "/" } },
            "fill_value": [0.0, 0.0],
            "codecs": [{ "name": "bytes", "configuration": { "endian": "little" } }],
            "dimension_names": ["row", "column"],
            "attributes": {},
        });
        let text = serde_json::to_string_pretty(&array)? + "\n";
        for (name, text) in [(PLAN, plan), (ARRAY, text.as_str())] {
            let mut file = File::create_new(folder.join(name))?;
            file.write_all(text.as_bytes())?;
            file.sync_all()?;
        }
        sync_folder(folder)
    }

    /// Opens the store in the folder `product`. `None` if there is none.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn open(product: &Path) -> Result<Option<Self>, StoreError> {
        let folder = product.join(NAME);
        let path = folder.join(ARRAY);
        if !path.exists() {
            return Ok(None);
        }
        let text = read_text(&path)?;
        let array: Value = serde_json::from_str(&text).unwrap_or_default();
        let codecs = array["codecs"].as_array();
        let plain = codecs
            .is_some_and(|all| all.len() == 1 && all[0]["configuration"]["endian"] == "little");
        let tiling = match array["data_type"] == "complex64" && plain {
            true => tiling_of(&array),
            false => None,
        };
        let Some(tiling) = tiling else {
            return Err(StoreError::Format {
                path,
                what: "this is no image of complex64 in plain tiles".to_owned(),
            });
        };
        let plan = read_text(&folder.join(PLAN))?;
        Ok(Some(Self {
            folder,
            tiling,
            plan,
        }))
    }

    /// Sizes of image and tiles.
    pub fn tiling(&self) -> Tiling {
        self.tiling
    }

    /// The plan's text.
    pub fn plan(&self) -> &str {
        &self.plan
    }

    /// The store's own folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Keeps other processes away from a part of the work, which `part` names, for as long as what is returned lives.
    ///
    /// # Errors
    /// [`WriteError`] if another process is at it.
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
        let [row, column] = self.tiling.at(index);
        let name = format!("{row}.{column}.json");
        self.folder.join(MARKS).join(name)
    }

    /// Writes a tile, row-major, and `note` of it.
    ///
    /// # Errors
    /// [`WriteError`]; the tile is then as it was.
    ///
    /// # Panics
    /// If there is no such tile, or `pixels` are not as many as it has.
    pub fn put(&self, index: usize, pixels: &[Complex32], note: &Value) -> Result<(), WriteError> {
        let [rows, columns] = self.tiling.place(index);
        assert_eq!(pixels.len(), rows.len() * columns.len());
        let mut crc = crc32fast::Hasher::new();
        let mut row_bytes = vec![0; 8 * self.tiling.tile[1]];
        let path = self.chunk(index);
        beside(&path, |out| {
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
        beside(&self.mark(index), |out| {
            serde_json::to_writer(&mut *out, &mark)?;
            out.write_all(b"\n")
        })
    }

    /// Tiles that are whole, and what was noted of each.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn done(&self) -> Result<BTreeMap<usize, Value>, StoreError> {
        let mut done = BTreeMap::new();
        for index in 0..self.tiling.count() {
            let path = self.mark(index);
            if !path.exists() {
                continue;
            }
            let mark: Value =
                serde_json::from_str(&read_text(&path)?).map_err(|error| StoreError::Format {
                    path,
                    what: format!("not the mark of a tile: {error}"),
                })?;
            done.insert(index, mark["note"].clone());
        }
        Ok(done)
    }

    /// Whether a tile is whole, by its mark.
    ///
    /// # Panics
    /// If there is no such tile.
    pub fn has(&self, index: usize) -> bool {
        self.mark(index).exists()
    }

    /// Pixels of every so manieth row and column of a tile, from `first` on, both counted within it: a glance, which reads these rows
    /// alone and so cannot look at the tile's CRC-32.
    ///
    /// # Errors
    /// [`StoreError`] if it cannot be read, or is too short.
    ///
    /// # Panics
    /// If there is no such tile, or a step is zero.
    pub fn glance(
        &self,
        index: usize,
        first: [usize; 2],
        steps: [usize; 2],
    ) -> Result<Image, StoreError> {
        let [rows, columns] = self.tiling.place(index);
        let path = self.chunk(index);
        let failed = |source| StoreError::Io {
            path: path.clone(),
            source,
        };
        let mut file = File::open(&path).map_err(failed)?;
        let mut line = vec![0; 8 * columns.len()];
        let mut image = Image {
            rows: 0,
            columns: (first[1]..columns.len()).step_by(steps[1]).len(),
            pixels: Vec::new(),
        };
        for row in (first[0]..rows.len()).step_by(steps[0]) {
            file.seek(SeekFrom::Start((8 * row * self.tiling.tile[1]) as u64))
                .map_err(failed)?;
            file.read_exact(&mut line).map_err(failed)?;
            let values = line.chunks_exact(8).skip(first[1]).step_by(steps[1]);
            image.pixels.extend(values.map(complex));
            image.rows += 1;
        }
        Ok(image)
    }

    /// Reads a tile, row-major.
    ///
    /// # Errors
    /// [`StoreError`], also if it is not what its mark says.
    ///
    /// # Panics
    /// If there is no such tile.
    pub fn read(&self, index: usize) -> Result<Vec<Complex32>, StoreError> {
        let [rows, columns] = self.tiling.place(index);
        let (path, mark_path) = (self.chunk(index), self.mark(index));
        let mark: Value = serde_json::from_str(&read_text(&mark_path)?).unwrap_or_default();
        let damaged = |what: String| StoreError::Damaged {
            path: path.clone(),
            mark: mark_path.clone(),
            what,
        };
        let failed = |source| StoreError::Io {
            path: path.clone(),
            source,
        };
        let mut file = File::open(&path).map_err(failed)?;
        let bytes = file.metadata().map_err(failed)?.len();
        if bytes != tile_bytes(&self.tiling) {
            let wanted = tile_bytes(&self.tiling);
            return Err(damaged(format!("it has {bytes} bytes and not {wanted}")));
        }
        let mut crc = crc32fast::Hasher::new();
        let mut row_bytes = vec![0; 8 * self.tiling.tile[1]];
        let mut pixels = Vec::with_capacity(rows.len() * columns.len());
        for row in 0..self.tiling.tile[0] {
            file.read_exact(&mut row_bytes).map_err(failed)?;
            crc.update(&row_bytes);
            if row < rows.len() {
                let values = row_bytes.chunks_exact(8).take(columns.len());
                pixels.extend(values.map(complex));
            }
        }
        let crc32 = format!("{:08x}", crc.finalize());
        match mark["crc32"].as_str() {
            Some(stated) if stated == crc32 => Ok(pixels),
            Some(stated) => Err(damaged(format!("its CRC-32 is {crc32} and not {stated}"))),
            None => Err(damaged("no CRC-32 of it is recorded".to_owned())),
        }
    }
}

impl Parts for TileStore {
    fn size(&self) -> (usize, usize) {
        let [rows, columns] = self.tiling.image;
        (rows, columns)
    }

    fn places(&self) -> Vec<Place> {
        (0..self.tiling.count())
            .map(|index| self.tiling.place(index))
            .collect()
    }

    fn window(&self, place: &Place) -> Result<Image, PartsError> {
        Ok(self.part(place)?)
    }
}

impl TileStore {
    /// A part of the image, from the tiles that it lies on.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn part(&self, place: &Place) -> Result<Image, StoreError> {
        let [rows, columns] = place;
        let mut window = Image {
            rows: rows.len(),
            columns: columns.len(),
            pixels: vec![Complex32::ZERO; rows.len() * columns.len()],
        };
        for index in self.tiling.meeting(place) {
            let tile = self.read(index)?;
            copy_common(place, &mut window.pixels, &self.tiling.place(index), &tile);
        }
        Ok(window)
    }
}

/// A value of eight bytes.
fn complex(bytes: &[u8]) -> Complex32 {
    let number = |bytes: &[u8]| f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
    Complex32::new(number(&bytes[..4]), number(&bytes[4..]))
}

/// A part of a store's work that no other process is at.
#[derive(Debug)]
pub struct Claimed {
    _lock: Arc<Lock>,
    _place: OutputPlace,
}

/// Numbers hidden files of this process.
static NUMBER: AtomicU64 = AtomicU64::new(0);

/// Writes a file beside, forces it to the disk and renames it. Its folder is ours, and the name no link.
fn beside(
    path: &Path,
    write: impl FnOnce(&mut io::BufWriter<&mut File>) -> io::Result<()>,
) -> Result<(), WriteError> {
    let (folder, name) = (
        path.parent().unwrap_or(Path::new("")),
        path.file_name().unwrap_or_default().to_string_lossy(),
    );
    let number = NUMBER.fetch_add(1, Ordering::Relaxed);
    let hidden = folder.join(format!(".{name}-{}-{number}", std::process::id()));
    unfinished::begin(Thing::File(hidden.clone()));
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

fn read_text(path: &Path) -> Result<String, StoreError> {
    let mut text = String::new();
    File::open(path)
        .and_then(|file| file.take(LONGEST_BYTES).read_to_string(&mut text))
        .map_err(|source| StoreError::Io {
            path: path.to_owned(),
            source,
        })?;
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

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
    fn tiles_come_back_and_say_when_they_are_damaged() {
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
        // Row 2 of tiles is row 4 of the image and a row of zeros, column 2 the image's column 6 and two of zeros.
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
        assert!(error.contains("3 bytes and not 48"), "{error}");
        // Any window is read from the tiles that it lies on.
        for index in 0..TILING.count() {
            store.put(index, &tile(index), &Value::Null).unwrap();
        }
        let window = again.window(&[1..5, 2..7]).unwrap();
        assert_eq!((window.rows, window.columns), (4, 5));
        for (i, z) in window.pixels.iter().enumerate() {
            let (row, column) = (1 + i / 5, 2 + i % 5);
            assert_eq!(*z, Complex32::new(row as f32, column as f32 + 0.5));
        }
        // A glance is of these rows and columns and no others, of tiles at the ends too.
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
        // Nothing is left beside.
        let names = fs::read_dir(product.join("image.zarr/c/1")).unwrap();
        assert_eq!(names.count(), 3);
        assert!(TileStore::create(&product, TILING, "").is_err());
    }

    #[test]
    fn what_is_no_store_is_refused() {
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
            assert!(error.contains("no image of complex64"), "{error}");
        }
    }

    #[test]
    fn a_part_is_one_process_s() {
        let folder = tempfile::tempdir().unwrap();
        let store = TileStore::create(folder.path(), TILING, "p").unwrap();
        let claimed = store.claim("1/8").unwrap();
        drop(claimed);
        store.claim("1/8").unwrap();
    }
}
