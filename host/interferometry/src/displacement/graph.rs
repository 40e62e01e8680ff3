//! Neighbours of points in the plane of the grid.

use std::collections::HashMap;

/// Neighbours of each quiet point, and quiet neighbours of a noisy one.
const NEIGHBOURS: usize = 8;
const ANCHORS: usize = 3;

/// Largest phase deviation of a quiet point, radians, where the median is smaller than a half of it.
const QUIET_RAD: f64 = 0.15;

/// Edges between neighbouring points, and the triangles that they form.
pub(super) struct Graph {
    /// Pairs of points, the lower number first.
    pub(super) edges: Vec<[usize; 2]>,
    /// Triangles of quiet points `p < q < r`, as the edges `pq`, `qr`, `pr`.
    pub(super) triangles: Vec<[usize; 3]>,
    /// Whether an edge is short: not the longest of any triangle. Short edges connect all points (relative neighbourhood graph, Toussaint 1980).
    pub(super) short: Vec<bool>,
    /// Number of the first edge of a noisy point.
    pub(super) noisy_from: usize,
}

impl Graph {
    /// Connect each quiet point with its nearest quiet neighbours, then the parts of this graph by the shortest edges from each smaller part, and at last each noisy point with its nearest quiet ones.
    ///
    /// Points are quiet up to a phase deviation of 0.15 rad, or of twice the median where that is larger. Noisy points so do not disturb the paths between quiet ones.
    pub(super) fn new(places: &[[f64; 2]], deviations: &[f64]) -> Self {
        let mut sorted = deviations.to_vec();
        let middle = sorted.len() / 2;
        let median = *sorted.select_nth_unstable_by(middle, f64::total_cmp).1;
        let most = QUIET_RAD.max(2.0 * median);
        let (quiet, noisy): (Vec<usize>, Vec<usize>) =
            (0..places.len()).partition(|&p| deviations[p] <= most);
        let mut edges = nearest(places, &quiet, &quiet, NEIGHBOURS);
        join_parts(places, &quiet, &mut edges);
        edges.sort_unstable();
        edges.dedup();
        let triangles = triangles(places.len(), &edges);
        let mut short = vec![true; edges.len()];
        for triangle in &triangles {
            let length = |edge: usize| {
                let [p, q] = edges[edge];
                square(places[p], places[q])
            };
            // Equal lengths in the order of the edges, so that no circle of them is removed.
            let longest = (triangle.iter().copied())
                .max_by(|&a, &b| length(a).total_cmp(&length(b)).then(a.cmp(&b)));
            if let Some(longest) = longest {
                short[longest] = false;
            }
        }
        let noisy_from = edges.len();
        edges.extend(nearest(places, &quiet, &noisy, ANCHORS));
        short.resize(edges.len(), true);
        Self {
            edges,
            triangles,
            short,
            noisy_from,
        }
    }
}

fn square(a: [f64; 2], b: [f64; 2]) -> f64 {
    let [x, y] = [a[0] - b[0], a[1] - b[1]];
    x * x + y * y
}

/// Edges from the points `from` to the nearest ones of `to`, by square cells with about two points each.
fn nearest(
    places: &[[f64; 2]],
    to: &[usize],
    from: &[usize],
    neighbours: usize,
) -> Vec<[usize; 2]> {
    let mut low = [f64::INFINITY; 2];
    let mut high = [f64::NEG_INFINITY; 2];
    for place in places {
        for i in 0..2 {
            low[i] = low[i].min(place[i]);
            high[i] = high[i].max(place[i]);
        }
    }
    let [width, height] = [high[0] - low[0], high[1] - low[1]];
    let count = to.len() as f64;
    let side = (2.0 * width * height / count)
        .sqrt()
        .max(2.0 * width.max(height) / count)
        .max(f64::MIN_POSITIVE);
    let cell = |place: &[f64; 2]| [0, 1].map(|i| ((place[i] - low[i]) / side) as i64);
    let mut cells: HashMap<[i64; 2], Vec<usize>> = HashMap::new();
    for &p in to {
        let place = &places[p];
        cells.entry(cell(place)).or_default().push(p);
    }
    let wanted = neighbours.min(to.len() - 1).max(1);
    let most = (width.max(height) / side) as i64 + 1;
    let mut edges = Vec::with_capacity(wanted * from.len());
    for &p in from {
        let place = &places[p];
        let [x, y] = cell(place);
        let mut near: Vec<(f64, usize)> = Vec::new();
        for ring in 0..=most {
            // Cells at the Chebyshev distance `ring`.
            for dx in -ring..=ring {
                let step = if dx.abs() == ring {
                    1
                } else {
                    (2 * ring).max(1)
                };
                for dy in (-ring..=ring).step_by(step as usize) {
                    let others = cells.get(&[x + dx, y + dy]).into_iter().flatten();
                    let others = others.filter(|&&q| q != p);
                    near.extend(others.map(|&q| (square(*place, places[q]), q)));
                }
            }
            near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            // Points in further rings are at least `ring` sides away.
            let safe = ring as f64 * side;
            if near.len() >= wanted && near[wanted - 1].0 <= safe * safe {
                break;
            }
        }
        near.truncate(wanted);
        edges.extend(near.iter().map(|&(_, q)| [p.min(q), p.max(q)]));
    }
    edges
}

/// Connect the parts of the graph: each part but the largest gets the shortest edge to another one, until one is left.
fn join_parts(places: &[[f64; 2]], points: &[usize], edges: &mut Vec<[usize; 2]>) {
    loop {
        let mut parts = Sets::new(places.len());
        for &[p, q] in edges.iter() {
            parts.join(p, q);
        }
        let mut members: HashMap<usize, Vec<usize>> = HashMap::new();
        for &p in points {
            members.entry(parts.root(p)).or_default().push(p);
        }
        if members.len() <= 1 {
            return;
        }
        let mut members: Vec<Vec<usize>> = members.into_values().collect();
        members.sort_unstable_by_key(|part| (part.len(), part[0]));
        members.pop();
        for part in &members {
            let own = parts.root(part[0]);
            let mut best = (f64::INFINITY, [0, 0]);
            for &p in part {
                for &q in points {
                    let length = square(places[p], places[q]);
                    if length < best.0 && parts.root(q) != own {
                        best = (length, [p.min(q), p.max(q)]);
                    }
                }
            }
            edges.push(best.1);
        }
    }
}

fn triangles(points: usize, edges: &[[usize; 2]]) -> Vec<[usize; 3]> {
    // Edges of each point to higher points.
    let mut upward: Vec<Vec<(usize, usize)>> = vec![Vec::new(); points];
    for (e, &[p, q]) in edges.iter().enumerate() {
        upward[p].push((q, e));
    }
    let mut triangles = Vec::new();
    for own in &upward {
        for (i, &(q, pq)) in own.iter().enumerate() {
            for &(r, pr) in &own[i + 1..] {
                if let Ok(at) = upward[q].binary_search_by_key(&r, |&(point, _)| point) {
                    triangles.push([pq, upward[q][at].1, pr]);
                }
            }
        }
    }
    triangles
}

/// Disjoint sets of points, each with its phase relative to the root of its set.
pub(super) struct Sets {
    parents: Vec<usize>,
    phases: Vec<f64>,
}

impl Sets {
    pub(super) fn new(points: usize) -> Self {
        Self {
            parents: (0..points).collect(),
            phases: vec![0.0; points],
        }
    }

    /// Root of a point's set; paths are compressed.
    pub(super) fn root(&mut self, point: usize) -> usize {
        let mut path = Vec::new();
        let mut at = point;
        while self.parents[at] != at {
            path.push(at);
            at = self.parents[at];
        }
        let mut phase = 0.0;
        for &p in path.iter().rev() {
            phase += self.phases[p];
            self.phases[p] = phase;
            self.parents[p] = at;
        }
        at
    }

    /// Phase of a point relative to the root of its set.
    pub(super) fn phase(&mut self, point: usize) -> f64 {
        let root = self.root(point);
        match root == point {
            true => 0.0,
            false => self.phases[point],
        }
    }

    fn join(&mut self, p: usize, q: usize) {
        self.join_at(p, q, 0.0);
    }

    /// Join two sets so that the phase of `q` less that of `p` is `difference`; `false` if they are one set already.
    pub(super) fn join_at(&mut self, p: usize, q: usize, difference: f64) -> bool {
        let (a, b) = (self.root(p), self.root(q));
        if a == b {
            return false;
        }
        let phase = self.phase(p) + difference - self.phase(q);
        self.parents[b] = a;
        self.phases[b] = phase;
        true
    }
}
