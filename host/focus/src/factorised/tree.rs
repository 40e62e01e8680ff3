//! Division of a grid into nested patches.
//!
//! Leaves have one size, except at the ends of the grid, and start at its first pixel. A patch of the next level consists of two by two leaves,
//! and so on up to the first patches. The position of a pixel's patches depends on these sizes only, independent of the part of the image that
//! is formed.

use crate::patch::{PatchSize, Rectangle};
use subaperture_model::geometry::ImageGrid;

/// Patch sizes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub(super) struct Tree {
    /// Rows and columns of a leaf.
    pub(super) leaf: [usize; 2],
    /// Number of levels above the leaves.
    pub(super) levels: usize,
}

/// Patch: level above the leaves, and row and column among the patches of that level.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Node {
    pub(super) level: usize,
    pub(super) at: [usize; 2],
}

/// Levels above the leaves that one thread processes alone.
pub(super) const TASK_LEVEL: usize = 2;

impl Tree {
    /// Level of the patches that threads process alone, with maps of patches of `map_level` and below.
    pub(super) fn task_level(&self, map_level: Option<usize>) -> usize {
        self.levels.min(map_level.unwrap_or(0).max(TASK_LEVEL))
    }

    /// Rows and columns of the patches of a level.
    pub(super) fn size(&self, level: usize) -> [usize; 2] {
        self.leaf.map(|side| side << level)
    }

    pub(super) fn patch_size(&self, level: usize) -> PatchSize {
        let [rows, columns] = self.size(level);
        PatchSize { rows, columns }
    }

    /// Pixels of a patch; `None` beyond the grid.
    pub(super) fn rectangle(&self, grid: &ImageGrid, node: Node) -> Option<Rectangle> {
        let image = [grid.rows.count, grid.columns.count];
        let size = self.size(node.level);
        let [rows, columns] = [0, 1].map(|i| {
            let first = node.at[i] * size[i];
            first..(first + size[i]).min(image[i])
        });
        let there = rows.start < rows.end && columns.start < columns.end;
        there.then(|| Rectangle::of(&[rows, columns]))
    }

    /// Patch of a level that contains a pixel.
    pub(super) fn around(&self, level: usize, [row, column]: [usize; 2]) -> Node {
        let [rows, columns] = self.size(level);
        Node {
            level,
            at: [row / rows, column / columns],
        }
    }

    /// First patches in row-major order.
    pub(super) fn roots(&self, grid: &ImageGrid) -> Vec<Node> {
        let [rows, columns] = self.size(self.levels);
        let (down, across) = (
            grid.rows.count.div_ceil(rows),
            grid.columns.count.div_ceil(columns),
        );
        let level = self.levels;
        (0..down)
            .flat_map(|row| {
                (0..across).map(move |column| Node {
                    level,
                    at: [row, column],
                })
            })
            .collect()
    }

    /// First patches that contain pixels of the given rectangles.
    pub(super) fn roots_of(&self, grid: &ImageGrid, places: &[Rectangle]) -> Vec<Node> {
        let mut roots = self.roots(grid);
        roots.retain(|&node| {
            let own = self.rectangle(grid, node);
            own.is_some_and(|own| places.iter().any(|other| own.meets(&other.place())))
        });
        roots
    }
}

impl Node {
    /// Four patches of the level below.
    pub(super) fn quarters(self) -> impl Iterator<Item = Self> {
        let Self {
            level,
            at: [row, column],
        } = self;
        [[0, 0], [0, 1], [1, 0], [1, 1]]
            .into_iter()
            .map(move |[down, across]| Self {
                level: level - 1,
                at: [2 * row + down, 2 * column + across],
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn leaves_cover_every_pixel_once() {
        let grid: ImageGrid = "x=0:100:1,y=0:37:1".parse().unwrap();
        let tree = Tree {
            leaf: [8, 12],
            levels: 2,
        };
        let mut seen = vec![0; grid.num_pixels() as usize];
        let mut patches = tree.roots(&grid);
        assert_eq!(patches.len(), 2 * 3);
        while let Some(node) = patches.pop() {
            let Some(rectangle) = tree.rectangle(&grid, node) else {
                continue;
            };
            let [rows, columns] = rectangle.place();
            assert_eq!(tree.around(node.level, [rows.start, columns.start]), node);
            if node.level > 0 {
                patches.extend(node.quarters());
                continue;
            }
            for row in rows {
                for column in columns.clone() {
                    seen[row * 100 + column] += 1;
                }
            }
        }
        assert!(seen.iter().all(|&times| times == 1));
    }
}
