//! Euclidean distance transform of a cell grid.

/// Euclidean distance (cells) of each cell to the nearest cell of a set.
///
/// Felzenszwalb and Huttenlocher, Distance Transforms of Sampled Functions: one lower envelope of parabolas per row.
pub(super) fn distances(size: [usize; 3], is_in_set: impl Fn(usize) -> bool) -> Vec<f32> {
    let [width, depth, height] = size;
    let far = (width + depth + height) as f32;
    let mut squares: Vec<f32> =
        (0..width * depth * height).map(|i| if is_in_set(i) { 0.0 } else { far * far }).collect();
    let mut envelope = Envelope::default();
    let strides = [1, width, width * depth];
    for axis in 0..3 {
        let (a, b) = [(1, 2), (0, 2), (0, 1)][axis];
        for j in 0..size[b] {
            for i in 0..size[a] {
                let start = i * strides[a] + j * strides[b];
                envelope.transform(&mut squares, start, strides[axis], size[axis]);
            }
        }
    }
    squares.iter_mut().for_each(|d| *d = d.sqrt());
    squares
}

/// Lower envelope of parabolas over a row.
#[derive(Default)]
struct Envelope {
    row: Vec<f32>,
    /// Parabolas of the envelope, and the start of each one's range.
    vertices: Vec<usize>,
    starts: Vec<f32>,
}

impl Envelope {
    /// Replaces each value f(q) of a row by min over p of f(p) + (p - q)².
    fn transform(&mut self, values: &mut [f32], start: usize, stride: usize, count: usize) {
        self.row.clear();
        self.row.extend((0..count).map(|q| values[start + q * stride]));
        self.vertices.clear();
        self.starts.clear();
        for q in 0..count {
            let height = |p: usize| self.row[p] + (p * p) as f32;
            let mut from = f32::NEG_INFINITY;
            while let (Some(&p), Some(&begin)) = (self.vertices.last(), self.starts.last()) {
                from = (height(q) - height(p)) / (2 * (q - p)) as f32;
                if from > begin {
                    break;
                }
                self.vertices.pop();
                self.starts.pop();
                from = f32::NEG_INFINITY;
            }
            self.vertices.push(q);
            self.starts.push(from);
        }
        let mut k = 0;
        for q in 0..count {
            while k + 1 < self.starts.len() && self.starts[k + 1] <= q as f32 {
                k += 1;
            }
            let p = self.vertices[k];
            let offset = q.abs_diff(p);
            values[start + q * stride] = self.row[p] + (offset * offset) as f32;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    #[test]
    fn distances_equal_the_minimum_over_all_cells_of_the_set() {
        let size = [9, 7, 5];
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let is_in_set: Vec<bool> = (0..9 * 7 * 5).map(|_| rng.random_bool(0.03)).collect();
        let at = |i: usize| [i % 9, i / 9 % 7, i / 63].map(|x| x as f32);
        for (i, distance) in distances(size, |i| is_in_set[i]).into_iter().enumerate() {
            let to = |j: usize| (0..3).map(|axis| (at(i)[axis] - at(j)[axis]).powi(2)).sum::<f32>();
            let set = (0..is_in_set.len()).filter(|&j| is_in_set[j]);
            let nearest = set.map(to).fold(f32::INFINITY, f32::min).sqrt();
            assert!((distance - nearest).abs() < 1e-5, "cell {i}: {distance}, not {nearest}");
        }
    }
}
