//! SIMD arithmetic with the same bits on every machine.
//!
//! The order of each sum is independent of the register width, and products are never fused with sums.

use half::f16;

/// Runs `work` with the best SIMD feature set of this processor. Callees benefit only if they are inlined.
#[cfg(not(target_arch = "wasm32"))]
#[inline]
pub fn with_simd<R>(work: impl FnOnce() -> R) -> R {
    pulp::Arch::new().dispatch(work)
}

/// Runs `work` directly: WebAssembly has one SIMD width.
#[cfg(target_arch = "wasm32")]
#[inline]
pub fn with_simd<R>(work: impl FnOnce() -> R) -> R {
    work()
}

/// Converts a finite half-precision number to single precision, exactly and without a branch.
///
/// Places sign and digits, then corrects the difference of the exponent biases (112) by a multiplication.
#[inline(always)]
pub(crate) fn f16_to_f32(half: f16) -> f32 {
    const BIAS: f32 = f32::from_bits((127 + 112) << 23);
    // The cast sign-extends; the mask clears the copies of the sign in the exponent.
    let placed = (i32::from(half.to_bits() as i16) << 13) as u32 & 0x8fff_e000;
    f32::from_bits(placed) * BIAS
}

/// Dot product in `N` interleaved partial sums.
#[inline(always)]
pub(crate) fn dot<const N: usize>(a: &[f32], b: &[f32]) -> f32 {
    let mut lanes = [0.0f32; N];
    let (a_chunks, b_chunks) = (a.chunks_exact(N), b.chunks_exact(N));
    let rest = a_chunks.remainder().iter().zip(b_chunks.remainder());
    let rest: f32 = rest.map(|(a, b)| a * b).sum();
    for (a, b) in a_chunks.zip(b_chunks) {
        for (lane, (a, b)) in lanes.iter_mut().zip(a.iter().zip(b)) {
            *lane += a * b;
        }
    }
    lanes.iter().sum::<f32>() + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_finite_half_converts_exactly() {
        for half in (0..=u16::MAX).map(f16::from_bits).filter(|half| half.is_finite()) {
            assert_eq!(f16_to_f32(half).to_bits(), half.to_f32().to_bits(), "{half}");
        }
    }

    #[test]
    fn dot_has_the_same_bits_at_any_register_width() {
        let wave = |k: usize| libm::sinf((k * k % 1009) as f32);
        let a: Vec<f32> = (0..1003).map(wave).collect();
        let b: Vec<f32> = (0..1003).map(|k| wave(k + 5)).collect();
        let mut lanes = [0.0f32; 16];
        for (i, (a, b)) in a.iter().zip(&b).enumerate().take(992) {
            lanes[i % 16] += a * b;
        }
        let rest: f32 = a[992..].iter().zip(&b[992..]).map(|(a, b)| a * b).sum();
        let wanted = lanes.iter().sum::<f32>() + rest;
        let got = with_simd(
            #[inline(always)]
            || dot::<16>(&a, &b),
        );
        assert_eq!(got.to_bits(), wanted.to_bits(), "{got} against {wanted}");
    }
}
