//! Access to the f32 storage of CPU tensors without copies.

use candle_core::{CpuStorage, Layout, Result, Storage, Tensor};

/// Values of a contiguous f32 tensor.
pub(crate) fn contiguous<'a>(storage: &'a CpuStorage, layout: &Layout) -> Result<&'a [f32]> {
    let values = storage.as_slice::<f32>()?;
    match layout.contiguous_offsets() {
        Some((start, end)) => Ok(&values[start..end]),
        None => candle_core::bail!("this operation requires contiguous tensors"),
    }
}

/// Calls `f` with the values of a contiguous f32 tensor, without a copy.
pub(crate) fn with_values<R>(tensor: &Tensor, f: impl FnOnce(&[f32]) -> R) -> Result<R> {
    let (storage, layout) = tensor.storage_and_layout();
    match &*storage {
        Storage::Cpu(storage) => Ok(f(contiguous(storage, layout)?)),
        _ => candle_core::bail!("training requires CPU tensors"),
    }
}
