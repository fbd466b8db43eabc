//! Named f32 tensors in safetensors files.

use anyhow::{Context, Result, ensure};
use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensors};
use std::collections::{BTreeMap, HashMap};

/// A named f32 tensor: name, shape, values.
pub type NamedTensor<'a> = (&'a str, Vec<usize>, &'a [f32]);

/// Encodes f32 tensors as safetensors, with an optional text as metadata.
pub fn encode(tensors: &[NamedTensor], metadata: Option<String>) -> Result<Vec<u8>> {
    let data: Vec<Vec<u8>> =
        tensors.iter().map(|(_, _, x)| x.iter().flat_map(|x| x.to_le_bytes()).collect()).collect();
    let views = tensors
        .iter()
        .zip(&data)
        .map(|((name, shape, _), bytes)| {
            Ok(((*name).to_owned(), TensorView::new(Dtype::F32, shape.clone(), bytes)?))
        })
        .collect::<Result<BTreeMap<_, _>>>()?;
    let metadata = metadata.map(|text| HashMap::from([("about".to_owned(), text)]));
    Ok(safetensors::serialize(views, metadata)?)
}

/// Reads the values of an f32 tensor.
pub fn read_f32(tensors: &SafeTensors, name: &str) -> Result<Vec<f32>> {
    let tensor = tensors.tensor(name).with_context(|| format!("the file has no tensor {name}"))?;
    ensure!(tensor.dtype() == Dtype::F32, "{name} has type {:?} instead of F32", tensor.dtype());
    let bytes = tensor.data();
    Ok(bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tensors_round_trip() {
        let pair: [NamedTensor; 2] = [("a", vec![2, 1], &[0.5, -1.0]), ("b", vec![0], &[])];
        let bytes = encode(&pair, Some("line".into())).unwrap();
        let tensors = SafeTensors::deserialize(&bytes).unwrap();
        assert_eq!(read_f32(&tensors, "a").unwrap(), [0.5, -1.0]);
        assert!(read_f32(&tensors, "c").unwrap_err().to_string().contains("no tensor c"));
        assert!(SafeTensors::deserialize(&bytes[..bytes.len() - 3]).is_err());
    }
}
