//! A section as turns around a closed orbit: its period, the centres of its phases, and the time of
//! capture.
//!
//! The last point has phase 0, the one before it phase 1, ..., modulo the period.

use super::Thresholds;
use super::verdict::Rate;
use twofold_num::elementary::{atan2, cos, ln, sin, sqrt};
use twofold_num::fit::{Line, line, median};

type Point = [f64; 2];

/// So much further than all before the last quarter of a run reaches if it grows without end: what
/// stays on a ring or an attractor reaches as far as before. No part of the [`Thresholds`], which
/// every committed file of a sweep repeats.
const GROWTH: f64 = 2.0;

/// Consecutive points of one direction, taken as turns around a cycle.
pub(super) struct Turns<'a> {
    points: &'a [Point],
    times: &'a [f64],
    /// Points per turn.
    pub period: usize,
    /// One per phase.
    pub centres: Vec<Point>,
    /// Largest distance from the centre in the window that decided the period, one per phase.
    pub spreads: Vec<f64>,
    /// Distance of each point from the centre of its phase.
    pub distances: Vec<f64>,
    /// Turns judged together.
    block: usize,
}

/// The part of a run that follows its final cycle.
pub(super) struct Captured {
    /// Index of its first point.
    pub from: usize,
    /// Blocks that were found to join.
    pub blocks: usize,
    /// Index of the first point from which on all are within a dot.
    pub settled: Option<usize>,
}

impl<'a> Turns<'a> {
    /// The longest period up to the limit whose phases stay apart over the last window; 1 if none
    /// does.
    pub fn find(points: &'a [Point], times: &'a [f64], extent: f64, th: &Thresholds) -> Self {
        let n = points.len();
        // Long enough that a ring is walked around, but of a short run the end only: its transient
        // must not move the centre.
        let shortest = n.min((20 * th.points_per_phase).min((n / 4).max(th.points_per_phase)));
        let mut best = (1, centres(points, 1, shortest));
        for period in (2..=th.longest_period).rev() {
            let mut window = shortest.max(period * th.points_per_phase);
            if window > shortest.max(n / 2) && n / 2 >= th.fewest_turns * period {
                // A short section: fewer turns are enough where every phase is a dot.
                let found = centres(points, period, (n / 4).max(th.fewest_turns * period));
                if found.1.iter().all(|s| *s <= th.dot * extent)
                    && smallest_gap(&found.0) > 2.0 * th.dot * extent
                {
                    best = (period, found);
                    break;
                }
            }
            while window <= shortest.max(n / 2) {
                let found = centres(points, period, window);
                let widest = found.1.iter().fold(0.0_f64, |a, b| a.max(*b));
                if smallest_gap(&found.0) <= (th.separation * widest).max(2.0 * th.dot * extent) {
                    break;
                }
                if widest <= th.dot * extent || !drifts(points, period, window, widest, th) {
                    best = (period, found);
                    break;
                }
                // Phases that go somewhere may be on their way around a slow island, or along a
                // ring next to a resonance: look longer.
                window *= 2;
            }
            if best.0 > 1 {
                break;
            }
        }
        let (period, (centres, spreads)) = best;
        let distances =
            (0..n).map(|i| distance(&points[i], &centres[(n - 1 - i) % period])).collect();
        let block = (n / period / 10).clamp(10, th.block);
        Self { points, times, period, centres, spreads, distances, block }
    }

    /// Follows the run backwards from its end, block by block, while it goes on turning around the
    /// cycle: in a dot, or on a smooth ring that joins the next one.
    pub fn captured(&self, extent: f64, th: &Thresholds) -> Option<Captured> {
        let n = self.points.len();
        let length = self.block * self.period;
        let dot = th.dot * extent;
        let mut blocks = 0;
        let mut next: Option<Ring> = None;
        while (blocks + 1) * length <= n {
            let ring = self.ring(n - (blocks + 1) * length, n - blocks * length);
            let joins = next.as_ref().is_none_or(|next| {
                next.largest <= dot || (ring.ends[1] - next.ends[0]).abs() <= th.continuity
            });
            if !(ring.largest <= dot || ring.thickness <= th.thickness && joins) {
                break;
            }
            blocks += 1;
            next = Some(ring);
        }
        // Within the first accepted block or before it: where exactly the points became dots.
        let settled = self.distances.iter().rposition(|d| *d > dot).map_or(0, |i| i + 1);
        let settled = (settled + 5 * self.period <= n).then_some(settled);
        let mut from = n - blocks * length;
        if let Some(s) = settled {
            // A fast approach fits within one block: follow it point by point through the linear
            // neighbourhood, equally far back whatever the run's length, on which a block's
            // depends. No further: small chaos may stay in that neighbourhood, too.
            let near = self.distances[..s]
                .iter()
                .rposition(|d| *d > th.linear_range * extent)
                .map_or(0, |i| i + 1);
            let reach = th.block * self.period;
            from = from.min(s).min(near.max(from.min(s).saturating_sub(reach)));
        }
        (blocks > 0 || settled.is_some()).then_some(Captured { from, blocks, settled })
    }

    /// The end of a kicked run, as far back as it stays within the linear neighbourhood of the
    /// cycle; `None` when it is not there for a whole window.
    pub fn cloud(&self, extent: f64, th: &Thresholds) -> Option<Captured> {
        let from =
            self.distances.iter().rposition(|d| *d > th.linear_range * extent).map_or(0, |i| i + 1);
        (from + self.period * th.points_per_phase <= self.points.len()).then_some(Captured {
            from,
            blocks: 0,
            settled: None,
        })
    }

    /// The straight-line fit to ln(distance) over the captured part, as far as it stays above the
    /// floor of what the settled run shows anyway.
    pub fn approach(&self, captured: &Captured) -> Option<Rate> {
        let n = self.points.len();
        let k = self.period;
        // Points that come back exactly show no floor: it is the rounding of their numbers.
        let size = self.centres.iter().flatten().fold(0.0_f64, |most, v| most.max(v.abs()));
        let rounding = 16.0 * f64::EPSILON * size;
        let floor = captured.settled.map_or(0.0, |s| {
            let mut rest = self.distances[s + (n - s) / 2..].to_vec();
            rest.sort_by(f64::total_cmp);
            rounding.max(3.0 * rest[(rest.len() - 1) * 9 / 10])
        });
        // One value per turn: the root mean square over its phases, at the time of its middle.
        let mut turns = Vec::new();
        let mut i = captured.from;
        while i + k <= n {
            let square: f64 =
                self.distances[i..i + k].iter().map(|d| d * d).sum::<f64>() / k as f64;
            let d = sqrt(square);
            if d <= floor || d == 0.0 {
                break;
            }
            turns.push((self.times[i + k / 2], ln(d)));
            i += k;
        }
        if turns.len() < 3 {
            return None;
        }
        // Groups of turns average over the shape of the ring.
        let size = turns.len().div_ceil(32);
        let grouped: Vec<(f64, f64)> = turns
            .chunks_exact(size)
            .map(|c| {
                let n = c.len() as f64;
                (c.iter().map(|p| p.0).sum::<f64>() / n, c.iter().map(|p| p.1).sum::<f64>() / n)
            })
            .collect();
        let Line { slope, slope_error, .. } = line(&grouped)?;
        Some(Rate {
            per_time: -slope,
            standard_error: slope_error,
            from: turns[0].0,
            to: turns[turns.len() - 1].0,
        })
    }

    /// Mean rotation per turn around the centres in the last block, in circles in (-1/2, 1/2].
    pub fn rotation(&self) -> Option<f64> {
        let n = self.points.len();
        let from = n.saturating_sub(self.block * self.period);
        let (mut c, mut s, mut count) = (0.0, 0.0, 0.0);
        for phase in 0..self.period {
            let rounded = self.round(phase, from, n)?;
            for pair in rounded.windows(2) {
                let (a, b) = (pair[0], pair[1]);
                let angle = atan2(b[1], b[0]) - atan2(a[1], a[0]);
                c += cos(angle);
                s += sin(angle);
                count += 1.0;
            }
        }
        // Increments that point everywhere have no mean.
        (sqrt(c * c + s * s) > 0.5 * count).then(|| atan2(s, c) / std::f64::consts::TAU)
    }

    /// The largest gap in angle between neighbours of one phase over the last `blocks` blocks, in
    /// circles, as seen from its centre: small on a ring that is filled; `None` when the points lie
    /// on a line.
    pub fn largest_gap(&self, blocks: usize) -> Option<f64> {
        let n = self.points.len();
        let from = n.saturating_sub(blocks * self.block * self.period);
        let mut largest = 0.0_f64;
        for phase in 0..self.period {
            let mut angles: Vec<f64> = self
                .round(phase, from, n)?
                .iter()
                .map(|p| atan2(p[1], p[0]) / std::f64::consts::TAU)
                .collect();
            angles.sort_by(f64::total_cmp);
            let around = 1.0 + angles.first()? - angles.last()?;
            largest = angles.windows(2).map(|w| w[1] - w[0]).fold(largest.max(around), f64::max);
        }
        Some(largest)
    }

    /// Mean distance from the centres in the last block, of a settled run without its approach.
    pub fn radius(&self, captured: &Captured) -> f64 {
        let block = self.distances.len().saturating_sub(self.block * self.period);
        let last = &self.distances[captured.settled.map_or(block, |s| s.max(block))..];
        last.iter().sum::<f64>() / last.len() as f64
    }

    /// Whether the last quarter of the run reaches much further from the centres than all before.
    pub fn grows(&self) -> bool {
        let largest = |d: &[f64]| d.iter().fold(0.0_f64, |a, b| a.max(*b));
        let (before, last) = self.distances.split_at(self.distances.len() / 4 * 3);
        largest(last) > GROWTH * largest(before)
    }

    /// Whether the run as a whole moves on, as what slowly comes to a rest or drifts does; what
    /// stays on a ring comes back to where it was.
    pub fn moves_on(&self, th: &Thresholds) -> bool {
        let n = self.points.len() as f64;
        let mean: Point =
            std::array::from_fn(|k| self.points.iter().map(|q| q[k]).sum::<f64>() / n);
        let spread = self.points.iter().map(|q| distance(q, &mean)).fold(0.0, f64::max);
        drifts(self.points, 1, self.points.len(), spread, th)
    }

    /// Mean duration of a turn in the last block.
    pub fn duration(&self) -> f64 {
        let n = self.times.len();
        let turns = self.block.min((n - 1) / self.period).max(1);
        (self.times[n - 1] - self.times[n - 1 - turns * self.period]) / turns as f64
    }

    /// Points of one phase in `from..to` in time order, seen from their centre and scaled so that
    /// their ellipse is a circle; `None` when they lie on a line.
    fn round(&self, phase: usize, from: usize, to: usize) -> Option<Vec<Point>> {
        let n = self.points.len();
        let c = self.centres[phase];
        let seen: Vec<Point> = (from..to)
            .filter(|i| (n - 1 - i) % self.period == phase)
            .map(|i| [self.points[i][0] - c[0], self.points[i][1] - c[1]])
            .collect();
        let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
        for p in &seen {
            xx += p[0] * p[0];
            xy += p[0] * p[1];
            yy += p[1] * p[1];
        }
        let trace = xx + yy;
        let determinant = xx * yy - xy * xy;
        // Aspect ratio above 1000: a line.
        if determinant.is_nan() || determinant <= 1e-6 * trace * trace {
            return None;
        }
        // Inverse of the Cholesky factor of the second moments.
        let l11 = sqrt(xx);
        let l21 = xy / l11;
        let l22 = sqrt((yy - l21 * l21).max(0.0));
        Some(
            seen.iter()
                .map(|p| {
                    let a = p[0] / l11;
                    [a, (p[1] - l21 * a) / l22]
                })
                .collect(),
        )
    }

    fn ring(&self, from: usize, to: usize) -> Ring {
        let n = self.points.len();
        let largest = self.distances[from..to].iter().fold(0.0_f64, |a, b| a.max(*b));
        let log = |i: usize| ln(self.distances[i].max(f64::MIN_POSITIVE));
        let tenth = ((to - from) / 10).max(self.period);
        let average = |a: usize, b: usize| (a..b).map(log).sum::<f64>() / (b - a) as f64;
        let ends = [average(from, from + tenth), average(to - tenth, to)];
        let (mut sum, mut count) = (0.0, 0.0);
        for phase in 0..self.period {
            let values: Vec<(f64, f64)> = match self.round(phase, from, to) {
                // By angle, with the logarithm of the distance seen in round coordinates.
                Some(p) => {
                    let logs: Vec<f64> = p
                        .iter()
                        .map(|q| 0.5 * ln((q[0] * q[0] + q[1] * q[1]).max(f64::MIN_POSITIVE)))
                        .collect();
                    let flat = detrended(&logs);
                    let mut v: Vec<_> =
                        p.iter().zip(flat).map(|(q, l)| (atan2(q[1], q[0]), l)).collect();
                    v.sort_by(|a, b| a.0.total_cmp(&b.0));
                    v
                }
                // On a line there is no angle: by time.
                None => {
                    let logs: Vec<f64> = (from..to)
                        .filter(|i| (n - 1 - i) % self.period == phase)
                        .map(log)
                        .collect();
                    detrended(&logs).into_iter().map(|l| (0.0, l)).collect()
                }
            };
            for pair in values.windows(2) {
                let d = pair[1].1 - pair[0].1;
                sum += d * d;
                count += 1.0;
            }
        }
        Ring { largest, ends, thickness: sqrt(sum / count / 2.0) }
    }
}

/// A block of turns seen as a ring around the centre.
struct Ring {
    /// Largest distance from the centre.
    largest: f64,
    /// Mean ln(distance) in the first and the last tenth.
    ends: [f64; 2],
    thickness: f64,
}

/// Centres and largest distances from them over the last `window` points.
fn centres(points: &[Point], period: usize, window: usize) -> (Vec<Point>, Vec<f64>) {
    let n = points.len();
    let mut centres = Vec::with_capacity(period);
    let mut spreads = Vec::with_capacity(period);
    for phase in 0..period {
        let mut own: Vec<Point> =
            (n - window..n).rev().skip(phase).step_by(period).map(|i| points[i]).collect();
        own.reverse();
        let centre = fixed_point(&own);
        spreads.push(own.iter().map(|p| distance(p, &centre)).fold(0.0, f64::max));
        centres.push(centre);
    }
    (centres, spreads)
}

/// Smallest distance between two of the points; infinite for one.
fn smallest_gap(points: &[Point]) -> f64 {
    let mut gap = f64::INFINITY;
    for (i, p) in points.iter().enumerate() {
        for q in &points[..i] {
            gap = gap.min(distance(p, q));
        }
    }
    gap
}

/// Whether some phase moves on during the last `window` points: the means of its halves differ by a
/// good part of its spread. On a ring whose rotation is nearly rational every phase creeps along
/// the ring and looks like a small cluster; around a cycle it stays.
fn drifts(points: &[Point], period: usize, window: usize, spread: f64, th: &Thresholds) -> bool {
    let n = points.len();
    (0..period).any(|phase| {
        let own: Vec<Point> =
            (n - window..n).rev().skip(phase).step_by(period).map(|i| points[i]).collect();
        let (late, early) = own.split_at(own.len() / 2);
        let mean = |s: &[Point]| -> Point {
            std::array::from_fn(|k| s.iter().map(|q| q[k]).sum::<f64>() / s.len() as f64)
        };
        distance(&mean(late), &mean(early)) > th.drift * spread
    })
}

/// The centre of consecutive images of one phase: the fixed point of the affine map p -> A p + b
/// that fits them best, which for a spiral is its eye also when the turns in the window are not
/// whole; their mean where that map is not determined or its fixed point is not among them.
fn fixed_point(p: &[Point]) -> Point {
    let n = p.len() as f64;
    let mean: Point = std::array::from_fn(|k| p.iter().map(|q| q[k]).sum::<f64>() / n);
    if p.len() < 6 {
        return mean;
    }
    let spread = p.iter().map(|q| distance(q, &mean)).fold(0.0, f64::max);
    // Normal equations for increments: p' - p = B (p - mean) + d, so the fixed point is mean - B^-1
    // d.
    let m = p.len() - 1;
    let before: Point =
        std::array::from_fn(|k| p[..m].iter().map(|q| q[k]).sum::<f64>() / m as f64);
    let change: Point = std::array::from_fn(|k| (p[m][k] - p[0][k]) / m as f64);
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    let mut cross = [[0.0; 2]; 2];
    for i in 0..m {
        let d = [p[i][0] - before[0], p[i][1] - before[1]];
        xx += d[0] * d[0];
        xy += d[0] * d[1];
        yy += d[1] * d[1];
        for (k, row) in cross.iter_mut().enumerate() {
            let step = p[i + 1][k] - p[i][k] - change[k];
            row[0] += step * d[0];
            row[1] += step * d[1];
        }
    }
    let determinant = xx * yy - xy * xy;
    let trace = xx + yy;
    if determinant.is_nan() || determinant <= 1e-6 * trace * trace {
        return mean;
    }
    let b: [[f64; 2]; 2] =
        cross.map(|[u, v]| [(u * yy - v * xy) / determinant, (v * xx - u * xy) / determinant]);
    let det_b = b[0][0] * b[1][1] - b[0][1] * b[1][0];
    let centre = [
        before[0] - (b[1][1] * change[0] - b[0][1] * change[1]) / det_b,
        before[1] - (b[0][0] * change[1] - b[1][0] * change[0]) / det_b,
    ];
    if distance(&centre, &mean) <= spread { centre } else { mean }
}

/// `values` without their linear trend in the index.
fn detrended(values: &[f64]) -> Vec<f64> {
    let points: Vec<(f64, f64)> = values.iter().enumerate().map(|(i, v)| (i as f64, *v)).collect();
    match line(&points) {
        Some(l) => points.iter().map(|(x, y)| y - l.intercept - l.slope * x).collect(),
        None => values.to_vec(),
    }
}

/// Centres and largest distances of the other direction's points, by phase, over the same number of
/// turns.
pub(super) fn other_dots(points: &[Point], period: usize, turns: usize) -> (Vec<Point>, Vec<f64>) {
    let window = points.len().min(turns * period);
    if window < period { (Vec::new(), Vec::new()) } else { centres(points, period, window) }
}

/// Distance in the plane.
pub(super) fn distance(a: &Point, b: &Point) -> f64 {
    let (x, y) = (a[0] - b[0], a[1] - b[1]);
    sqrt(x * x + y * y)
}

/// Mean time between consecutive points.
pub(super) fn return_time(times: &[f64]) -> f64 {
    let mut gaps: Vec<f64> = times.windows(2).map(|w| w[1] - w[0]).collect();
    if gaps.is_empty() {
        return f64::NAN;
    }
    // The median says whether times are sane; the mean is what a rate needs.
    if median(&mut gaps) > 0.0 {
        (times[times.len() - 1] - times[0]) / gaps.len() as f64
    } else {
        f64::NAN
    }
}

#[cfg(test)]
mod tests;
