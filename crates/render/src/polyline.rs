//! Clipping and thinning of polylines and polygons before they are drawn.

/// Parts of a polyline inside a box, in any dimension (Liang & Barsky 1984). Vertices that are not
/// finite break the line.
pub fn clip<const N: usize>(
    points: &[[f64; N]],
    lower: [f64; N],
    upper: [f64; N],
) -> Vec<Vec<[f64; N]>> {
    let mut parts: Vec<Vec<[f64; N]>> = Vec::new();
    let mut current: Vec<[f64; N]> = Vec::new();
    for pair in points.windows(2) {
        match clip_segment(pair[0], pair[1], lower, upper) {
            Some((a, b)) => {
                if current.last() != Some(&a) {
                    if current.len() > 1 {
                        parts.push(std::mem::take(&mut current));
                    }
                    current.clear();
                    current.push(a);
                }
                current.push(b);
            }
            None => {
                if current.len() > 1 {
                    parts.push(std::mem::take(&mut current));
                }
                current.clear();
            }
        }
    }
    if current.len() > 1 {
        parts.push(current);
    }
    parts
}

fn clip_segment<const N: usize>(
    a: [f64; N],
    b: [f64; N],
    lower: [f64; N],
    upper: [f64; N],
) -> Option<([f64; N], [f64; N])> {
    if !a.iter().chain(&b).all(|v| v.is_finite()) {
        return None;
    }
    let (mut enter, mut leave) = (0.0f64, 1.0f64);
    for i in 0..N {
        let d = b[i] - a[i];
        for (distance, slope) in [(a[i] - lower[i], -d), (upper[i] - a[i], d)] {
            // The segment is inside this plane where slope * t <= distance.
            if slope == 0.0 {
                if distance < 0.0 {
                    return None;
                }
            } else if slope > 0.0 {
                leave = leave.min(distance / slope);
            } else {
                enter = enter.max(distance / slope);
            }
        }
    }
    if enter > leave {
        return None;
    }
    let at = |t: f64| {
        if t == 0.0 {
            a
        } else if t == 1.0 {
            b
        } else {
            std::array::from_fn(|i| (a[i] + t * (b[i] - a[i])).clamp(lower[i], upper[i]))
        }
    };
    Some((at(enter), at(leave)))
}

/// The part of a polygon inside a box, in any dimension (Sutherland & Hodgman 1974). Empty if a
/// corner is not finite.
pub fn clip_polygon<const N: usize>(
    corners: &[[f64; N]],
    lower: [f64; N],
    upper: [f64; N],
) -> Vec<[f64; N]> {
    if !corners.iter().flatten().all(|v| v.is_finite()) {
        return Vec::new();
    }
    let mut polygon = corners.to_vec();
    for i in 0..N {
        for (bound, sign) in [(lower[i], 1.0), (upper[i], -1.0)] {
            let inside = |p: &[f64; N]| sign * (p[i] - bound) >= 0.0;
            let mut next = Vec::with_capacity(polygon.len() + 2);
            for (k, b) in polygon.iter().enumerate() {
                let a = &polygon[(k + polygon.len() - 1) % polygon.len()];
                if inside(a) != inside(b) {
                    let t = (bound - a[i]) / (b[i] - a[i]);
                    let mut cut: [f64; N] = std::array::from_fn(|j| a[j] + t * (b[j] - a[j]));
                    cut[i] = bound;
                    next.push(cut);
                }
                if inside(b) {
                    next.push(*b);
                }
            }
            polygon = next;
        }
    }
    polygon
}

/// Leaves out vertices that lie within `tolerance` of the line drawn without them (Douglas &
/// Peucker 1973), judged by `at`, their place on the sheet. The first and the last stay. Long lines
/// are first cut into pieces, which bounds the work.
pub fn thin<P: Copy>(points: &[P], tolerance: f64, at: impl Fn(&P) -> [f64; 2]) -> Vec<P> {
    const PIECE: usize = 512;
    if points.len() < 3 {
        return points.to_vec();
    }
    // Vertices closer to the last kept one than half the tolerance cannot matter.
    let mut kept = vec![points[0]];
    let mut last = at(&points[0]);
    for p in &points[1..points.len() - 1] {
        let q = at(p);
        let (dx, dy) = (q[0] - last[0], q[1] - last[1]);
        if dx * dx + dy * dy > 0.25 * tolerance * tolerance {
            kept.push(*p);
            last = q;
        }
    }
    kept.push(points[points.len() - 1]);
    let places: Vec<[f64; 2]> = kept.iter().map(at).collect();
    let mut keep = vec![false; kept.len()];
    let mut stack = Vec::new();
    let mut start = 0;
    while start + 1 < kept.len() {
        let end = (start + PIECE).min(kept.len() - 1);
        (keep[start], keep[end]) = (true, true);
        stack.push((start, end));
        while let Some((a, b)) = stack.pop() {
            let mut worst = (tolerance * tolerance, 0);
            for (i, p) in places.iter().enumerate().take(b).skip(a + 1) {
                let d = distance_squared(*p, places[a], places[b]);
                if d > worst.0 {
                    worst = (d, i);
                }
            }
            if worst.1 > 0 {
                keep[worst.1] = true;
                stack.push((a, worst.1));
                stack.push((worst.1, b));
            }
        }
        start = end;
    }
    kept.iter().zip(keep).filter(|(_, k)| *k).map(|(p, _)| *p).collect()
}

fn distance_squared(p: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
    let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
    let length = dx * dx + dy * dy;
    let t = if length > 0.0 {
        (((p[0] - a[0]) * dx + (p[1] - a[1]) * dy) / length).clamp(0.0, 1.0)
    } else {
        0.0
    };
    let (ex, ey) = (a[0] + t * dx - p[0], a[1] + t * dy - p[1]);
    ex * ex + ey * ey
}

/// Cuts a polyline into dashes of length `on` separated by gaps of length `off`, measured by `at`;
/// `between` interpolates.
pub fn dashes(points: &[[f64; 2]], on: f64, off: f64) -> Vec<Vec<[f64; 2]>> {
    let mut parts = Vec::new();
    let Some(first) = points.first() else { return parts };
    let mut current = vec![*first];
    let (mut drawing, mut left) = (true, on);
    for pair in points.windows(2) {
        let (a, b) = (pair[0], pair[1]);
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        let length = (dx * dx + dy * dy).sqrt();
        let mut done = 0.0;
        while length - done > left {
            done += left;
            let p = [a[0] + dx * done / length, a[1] + dy * done / length];
            if drawing {
                current.push(p);
                parts.push(std::mem::take(&mut current));
            } else {
                current = vec![p];
            }
            drawing = !drawing;
            left = if drawing { on } else { off };
        }
        left -= length - done;
        if drawing {
            current.push(b);
        }
    }
    if drawing && current.len() > 1 {
        parts.push(current);
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;
    use twofold_num::elementary;

    const LOWER: [f64; 2] = [0.0, 0.0];
    const UPPER: [f64; 2] = [1.0, 1.0];

    #[test]
    fn a_line_that_leaves_and_returns_becomes_two() {
        let parts = clip(&[[0.5, 0.5], [0.5, 1.5], [0.8, 1.5], [0.8, 0.2]], LOWER, UPPER);
        assert_eq!(parts, [vec![[0.5, 0.5], [0.5, 1.0]], vec![[0.8, 1.0], [0.8, 0.2]]]);
    }

    #[test]
    fn a_line_through_a_corner_region_misses_the_box() {
        assert!(clip(&[[-1.0, 0.5], [0.5, 2.1]], LOWER, UPPER).is_empty());
        assert_eq!(clip(&[[-1.0, 0.5], [2.0, 0.5]], LOWER, UPPER), [vec![[0.0, 0.5], [1.0, 0.5]]]);
    }

    #[test]
    fn a_vertex_that_is_no_number_breaks_the_line() {
        let parts =
            clip(&[[0.1, 0.1], [0.2, 0.2], [f64::NAN, 0.3], [0.4, 0.4], [0.5, 0.4]], LOWER, UPPER);
        assert_eq!(parts.len(), 2);
    }

    #[test]
    fn a_polygon_is_cut_at_the_box() {
        let cut = clip_polygon(&[[-1.0, -1.0], [2.0, -1.0], [2.0, 0.5], [-1.0, 0.5]], LOWER, UPPER);
        let area: f64 = (0..cut.len())
            .map(|i| (cut[i], cut[(i + 1) % cut.len()]))
            .map(|(a, b)| 0.5 * (a[0] * b[1] - b[0] * a[1]))
            .sum();
        assert!((area - 0.5).abs() < 1e-12, "{area}");
        assert!(clip_polygon(&[[2.0, 2.0], [3.0, 2.0], [3.0, 3.0]], LOWER, UPPER).is_empty());
    }

    #[test]
    fn thinning_stays_within_its_tolerance() {
        let curve: Vec<[f64; 2]> = (0..20_000)
            .map(|i| f64::from(i) * 1e-3)
            .map(|t| [t, elementary::sin(3.0 * t)])
            .collect();
        let thinned = thin(&curve, 1e-3, |p| *p);
        assert!(thinned.len() < 1500, "{}", thinned.len());
        for p in &curve {
            let nearest = thinned
                .windows(2)
                .map(|w| distance_squared(*p, w[0], w[1]))
                .fold(f64::INFINITY, f64::min);
            assert!(nearest <= 1.6e-3 * 1.6e-3, "{nearest}");
        }
    }

    #[test]
    fn dashes_cover_their_share_of_the_length() {
        let parts = dashes(&[[0.0, 0.0], [10.0, 0.0], [10.0, 10.0]], 3.0, 1.0);
        assert_eq!(parts.len(), 5);
        assert_eq!(parts[0], [[0.0, 0.0], [3.0, 0.0]]);
        assert_eq!(parts[2], [[8.0, 0.0], [10.0, 0.0], [10.0, 1.0]]);
    }
}
