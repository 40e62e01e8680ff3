//! Optimal assignment of rows to columns with optional pairs.

/// Pair of a row and a column that may be assigned, with its cost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pair {
    /// Index of the row.
    pub(super) row: usize,
    /// Index of the column.
    pub(super) column: usize,
    /// Cost relative to leaving both unassigned. Pairs of a cost of 0 or more are not assigned.
    pub(super) cost: f64,
}

/// Column of each row in the assignment of least total cost. Each column has at most one row; only `pairs` are assigned.
///
/// Rows and columns that pairs link form a group; groups are solved separately. Time is the sum over groups of the smaller side squared times the
/// larger one, memory the product of the sides of the largest group.
pub(super) fn assign(rows: usize, columns: usize, pairs: &[Pair]) -> Vec<Option<usize>> {
    let useful = |pair: &&Pair| pair.cost < 0.0;
    let mut groups = Groups::new(rows + columns);
    for pair in pairs.iter().filter(useful) {
        groups.join(pair.row, rows + pair.column);
    }
    let mut members: Vec<Vec<Pair>> = vec![Vec::new(); rows];
    let mut slot = vec![usize::MAX; rows + columns];
    let mut used = 0;
    for pair in pairs.iter().filter(useful) {
        let root = groups.root(pair.row);
        if slot[root] == usize::MAX {
            slot[root] = used;
            used += 1;
        }
        members[slot[root]].push(*pair);
    }
    let mut assigned = vec![None; rows];
    for group in &members[..used] {
        for (row, column) in solve_group(group) {
            assigned[row] = Some(column);
        }
    }
    assigned
}

/// Disjoint sets with path halving.
struct Groups(Vec<usize>);

impl Groups {
    fn new(size: usize) -> Self {
        Self((0..size).collect())
    }

    fn root(&mut self, mut at: usize) -> usize {
        while self.0[at] != at {
            self.0[at] = self.0[self.0[at]];
            at = self.0[at];
        }
        at
    }

    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a] = b;
    }
}

/// Assigned rows and columns of a group.
fn solve_group(pairs: &[Pair]) -> Vec<(usize, usize)> {
    let distinct = |of: fn(&Pair) -> usize| {
        let mut values: Vec<usize> = pairs.iter().map(of).collect();
        values.sort_unstable();
        values.dedup();
        values
    };
    let (rows, columns) = (distinct(|pair| pair.row), distinct(|pair| pair.column));
    let wide = rows.len() <= columns.len();
    let (short, long) = match wide {
        true => (&rows, &columns),
        false => (&columns, &rows),
    };
    // Elements without a pair cost 0: assigned, they count as unassigned.
    let mut costs = vec![0.0; short.len() * long.len()];
    for pair in pairs {
        let (own, other) = match wide {
            true => (pair.row, pair.column),
            false => (pair.column, pair.row),
        };
        let place = short.partition_point(|&value| value < own) * long.len()
            + long.partition_point(|&value| value < other);
        costs[place] = pair.cost;
    }
    let chosen = shortest_paths(&costs, short.len(), long.len());
    let linked = chosen
        .into_iter()
        .enumerate()
        .filter(|&(i, j)| costs[i * long.len() + j] < 0.0);
    let pair = |(i, j): (usize, usize)| match wide {
        true => (short[i], long[j]),
        false => (long[j], short[i]),
    };
    linked.map(pair).collect()
}

/// Column of each row in the complete assignment of least cost, for `rows <= columns` and row-major `costs`: one shortest augmenting path per row,
/// with dual variables of rows and columns that keep reduced costs nonnegative.
fn shortest_paths(costs: &[f64], rows: usize, columns: usize) -> Vec<usize> {
    // Column `columns` is the start of a path.
    let mut row_of = vec![usize::MAX; columns + 1];
    let mut row_dual = vec![0.0; rows];
    let mut column_dual = vec![0.0; columns + 1];
    for start in 0..rows {
        let mut length = vec![f64::INFINITY; columns];
        let mut previous = vec![columns; columns];
        let mut settled = vec![false; columns + 1];
        row_of[columns] = start;
        let mut column = columns;
        while row_of[column] != usize::MAX {
            settled[column] = true;
            let row = row_of[column];
            let (mut least, mut next) = (f64::INFINITY, columns);
            for j in (0..columns).filter(|&j| !settled[j]) {
                let reduced = costs[row * columns + j] - row_dual[row] - column_dual[j];
                if reduced < length[j] {
                    (length[j], previous[j]) = (reduced, column);
                }
                if length[j] < least {
                    (least, next) = (length[j], j);
                }
            }
            for j in 0..=columns {
                if settled[j] {
                    row_dual[row_of[j]] += least;
                    column_dual[j] -= least;
                } else if j < columns {
                    length[j] -= least;
                }
            }
            column = next;
        }
        while column != columns {
            row_of[column] = row_of[previous[column]];
            column = previous[column];
        }
    }
    let mut chosen = vec![0; rows];
    for (column, &row) in row_of[..columns].iter().enumerate() {
        if row != usize::MAX {
            chosen[row] = column;
        }
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Least cost of the rows from `row` on, by trying every column for each.
    fn least(costs: &[Vec<Option<f64>>], row: usize, taken: &mut Vec<bool>) -> f64 {
        let Some(own) = costs.get(row) else {
            return 0.0;
        };
        let mut best = least(costs, row + 1, taken);
        for (column, cost) in own.iter().enumerate() {
            if let (Some(cost), false) = (cost, taken[column]) {
                taken[column] = true;
                best = best.min(cost + least(costs, row + 1, taken));
                taken[column] = false;
            }
        }
        best
    }

    #[test]
    fn assignment_has_the_least_cost_of_all() {
        let mut state = 1u64;
        let mut random = |below: u64| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) % below
        };
        for case in 0..3000 {
            let (rows, columns) = (random(7) as usize, random(7) as usize);
            let density = 1 + random(10);
            let mut costs = vec![vec![None; columns]; rows];
            let mut pairs = Vec::new();
            for (row, own) in costs.iter_mut().enumerate() {
                for (column, cost) in own.iter_mut().enumerate() {
                    if random(10) < density {
                        // Multiples of 1/8, with ties and some above 0: sums are exact.
                        let value = random(100) as f64 / 8.0 - 10.0;
                        *cost = Some(value);
                        pairs.push(Pair {
                            row,
                            column,
                            cost: value,
                        });
                    }
                }
            }
            let assigned = assign(rows, columns, &pairs);
            let mut taken = vec![false; columns];
            let mut total = 0.0;
            for (row, column) in assigned.iter().enumerate() {
                if let &Some(column) = column {
                    assert!(!std::mem::replace(&mut taken[column], true));
                    total += costs[row][column].expect("only pairs are assigned");
                }
            }
            let best = least(&costs, 0, &mut vec![false; columns]);
            assert_eq!(total, best, "case {case}: {pairs:?}");
        }
    }

    #[test]
    fn two_hundred_rows_take_their_own_columns() {
        let cost = |row: usize, column: usize| match row == (column * 7) % 200 {
            true => -20.0,
            false => -10.0 - ((row * 31 + column * 17) % 90) as f64 / 10.0,
        };
        let cell = |i: usize| Pair {
            row: i / 200,
            column: i % 200,
            cost: cost(i / 200, i % 200),
        };
        let pairs: Vec<Pair> = (0..200 * 200).map(cell).collect();
        for (row, column) in assign(200, 200, &pairs).into_iter().enumerate() {
            assert_eq!(column.map(|column| (column * 7) % 200), Some(row));
        }
    }
}
