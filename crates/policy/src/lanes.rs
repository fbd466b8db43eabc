//! Arithmetic on many numbers at once, with the same bits on every machine.
//!
//! Sums have one order whatever the width of the registers, and products are never fused with sums.

use half::f16;

/// Runs `work` with the widest registers that this processor has. What it calls is compiled for them
/// only where it is inlined.
#[cfg(not(target_arch = "wasm32"))]
#[inline]
pub fn widest<R>(work: impl FnOnce() -> R) -> R {
    pulp::Arch::new().dispatch(work)
}

/// Runs `work`: a browser has lanes of one width.
#[cfg(target_arch = "wasm32")]
#[inline]
pub fn widest<R>(work: impl FnOnce() -> R) -> R {
    work()
}

/// A finite half-precision number in single precision, exactly and without a branch: sign and digits in
/// place, then the difference of the exponents' biases (112) by a product.
#[inline(always)]
pub(crate) fn widen(half: f16) -> f32 {
    const BIAS: f32 = f32::from_bits((127 + 112) << 23);
    // The cast fills up with the sign; what it leaves in the exponent is masked.
    let placed = (i32::from(half.to_bits() as i16) << 13) as u32 & 0x8fff_e000;
    f32::from_bits(placed) * BIAS
}

/// Sum of products in `N` interleaved partial sums; `value` reads the entries of `a`.
#[inline(always)]
pub(crate) fn dot<const N: usize, T: Copy>(
    a: &[T],
    b: &[f32],
    value: impl Fn(T) -> f32 + Copy,
) -> f32 {
    let mut lanes = [0.0f32; N];
    let (a_chunks, b_chunks) = (a.chunks_exact(N), b.chunks_exact(N));
    let rest = a_chunks.remainder().iter().zip(b_chunks.remainder());
    let rest: f32 = rest.map(|(a, b)| value(*a) * b).sum();
    for (a, b) in a_chunks.zip(b_chunks) {
        for (lane, (a, b)) in lanes.iter_mut().zip(a.iter().zip(b)) {
            *lane += value(*a) * b;
        }
    }
    lanes.iter().sum::<f32>() + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_finite_half_is_widened_exactly() {
        for half in (0..=u16::MAX).map(f16::from_bits).filter(|half| half.is_finite()) {
            assert_eq!(widen(half).to_bits(), half.to_f32().to_bits(), "{half}");
        }
    }

    #[test]
    fn wide_registers_give_the_same_bits() {
        let wave = |k: usize| libm::sinf((k * k % 1009) as f32);
        let a: Vec<f16> = (0..1003).map(wave).map(f16::from_f32).collect();
        let b: Vec<f32> = (0..1003).map(|k| wave(k + 5)).collect();
        let mut lanes = [0.0f32; 16];
        for (i, (a, b)) in a.iter().zip(&b).enumerate().take(992) {
            lanes[i % 16] += a.to_f32() * b;
        }
        let rest: f32 = a[992..].iter().zip(&b[992..]).map(|(a, b)| a.to_f32() * b).sum();
        let wanted = lanes.iter().sum::<f32>() + rest;
        let got = widest(
            #[inline(always)]
            || dot::<16, _>(&a, &b, widen),
        );
        assert_eq!(got.to_bits(), wanted.to_bits(), "{got} against {wanted}");
    }
}
