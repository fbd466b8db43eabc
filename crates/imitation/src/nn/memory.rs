//! The numbers of tensors where they lie.

use candle_core::{CpuStorage, Layout, Result, Storage, Tensor};

/// The values of a contiguous f32 tensor.
pub(crate) fn contiguous<'a>(storage: &'a CpuStorage, layout: &Layout) -> Result<&'a [f32]> {
    let values = storage.as_slice::<f32>()?;
    match layout.contiguous_offsets() {
        Some((start, end)) => Ok(&values[start..end]),
        None => candle_core::bail!("this operation needs contiguous tensors"),
    }
}

/// Reads the values of a contiguous f32 tensor without a copy.
pub(crate) fn read<R>(tensor: &Tensor, what: impl FnOnce(&[f32]) -> R) -> Result<R> {
    let (storage, layout) = tensor.storage_and_layout();
    match &*storage {
        Storage::Cpu(storage) => Ok(what(contiguous(storage, layout)?)),
        _ => candle_core::bail!("what is trained lies in the processor's memory"),
    }
}
