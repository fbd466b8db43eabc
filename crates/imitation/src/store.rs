//! Files of a dataset: safetensors with a line of JSON, written atomically.

use crate::dataset::PoseRecord;
use anyhow::{Context, Result, ensure};
use policy::encoder::CLOUD;
use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensors};
use std::collections::{BTreeMap, HashMap};
use std::path::Path;

/// Writes beside the target and renames, so that a killed process leaves the old file or the new one.
pub fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    let folder = path.parent().context("a file needs a folder")?;
    std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    let beside = path.with_extension(format!("part-{}", std::process::id()));
    std::fs::write(&beside, bytes).with_context(|| format!("cannot write {}", beside.display()))?;
    std::fs::rename(&beside, path).with_context(|| format!("cannot write {}", path.display()))
}

/// Bytes of a set of f32 tensors, given as name, shape, values.
pub fn encode(tensors: &[(&str, Vec<usize>, &[f32])], about: Option<String>) -> Result<Vec<u8>> {
    let data: Vec<Vec<u8>> =
        tensors.iter().map(|(_, _, x)| x.iter().flat_map(|x| x.to_le_bytes()).collect()).collect();
    let views = tensors
        .iter()
        .zip(&data)
        .map(|((name, shape, _), bytes)| {
            Ok(((*name).to_owned(), TensorView::new(Dtype::F32, shape.clone(), bytes)?))
        })
        .collect::<Result<BTreeMap<_, _>>>()?;
    let about = about.map(|text| HashMap::from([("about".to_owned(), text)]));
    Ok(safetensors::serialize(views, about)?)
}

/// Values of an f32 tensor.
pub fn values(tensors: &SafeTensors, name: &str) -> Result<Vec<f32>> {
    let tensor = tensors.tensor(name)?;
    ensure!(tensor.dtype() == Dtype::F32, "{name} holds {:?} instead of F32", tensor.dtype());
    let bytes = tensor.data();
    Ok(bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect())
}

pub(crate) fn encode_pose(record: &PoseRecord) -> Result<Vec<u8>> {
    let row = 2 * robot::DOF;
    let offsets: Vec<f32> = record.offsets.iter().map(|&i| i as f32).collect();
    let clouds = record.clouds.concat();
    let about = serde_json::to_string(&record.counts)?;
    encode(
        &[
            ("states", vec![record.states.len() / row, row], &record.states),
            ("offsets", vec![offsets.len()], &offsets),
            ("pose", vec![3], &record.pose),
            ("turns", vec![record.turns.len()], &record.turns),
            ("clouds", vec![clouds.len() / (3 * CLOUD), CLOUD, 3], &clouds),
        ],
        Some(about),
    )
}

pub(crate) fn decode_pose(bytes: &[u8]) -> Result<PoseRecord> {
    let tensors = SafeTensors::deserialize(bytes)?;
    let (_, header) = SafeTensors::read_metadata(bytes)?;
    let about = header.metadata().as_ref().and_then(|m| m.get("about")).cloned();
    let pose = values(&tensors, "pose")?;
    let states = values(&tensors, "states")?;
    let offsets: Vec<usize> =
        values(&tensors, "offsets")?.iter().map(|&first| first as usize).collect();
    let turns = values(&tensors, "turns")?;
    let rows = states.len() / (2 * robot::DOF);
    ensure!(
        offsets.first() == Some(&0) && offsets.is_sorted() && offsets.last() == Some(&rows),
        "its trajectories do not fill its {rows} rows"
    );
    let clouds: Vec<Vec<f32>> =
        values(&tensors, "clouds")?.chunks_exact(3 * CLOUD).map(<[f32]>::to_vec).collect();
    ensure!(
        !clouds.is_empty() && clouds.len().is_multiple_of(turns.len().max(1)),
        "its {} clouds are not as many at each of {} bearings",
        clouds.len(),
        turns.len()
    );
    Ok(PoseRecord {
        pose: pose.try_into().ok().context("a pose has three numbers")?,
        states,
        offsets,
        turns,
        clouds,
        counts: serde_json::from_str(&about.context("counts are missing")?)?,
    })
}

pub(crate) fn encode_clouds(clouds: &[Vec<f32>]) -> Result<Vec<u8>> {
    encode(&[("clouds", vec![clouds.len(), CLOUD, 3], &clouds.concat())], None)
}

pub(crate) fn decode_clouds(bytes: &[u8]) -> Result<Vec<Vec<f32>>> {
    let tensors = SafeTensors::deserialize(bytes)?;
    Ok(values(&tensors, "clouds")?.chunks_exact(3 * CLOUD).map(<[f32]>::to_vec).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_comes_back_as_it_was() {
        let record = PoseRecord {
            pose: [0.5, 0.1, -1.0],
            states: (0..3 * 46).map(|x| x as f32).collect(),
            offsets: vec![0, 2, 3],
            turns: vec![0.0, 0.2],
            clouds: vec![vec![0.25; 3 * CLOUD]; 2],
            counts: BTreeMap::from([("lifted".to_owned(), 2)]),
        };
        let back = decode_pose(&encode_pose(&record).unwrap()).unwrap();
        assert_eq!(back.states, record.states);
        assert_eq!((back.pose, &back.offsets), (record.pose, &record.offsets));
        assert_eq!((&back.turns, &back.clouds), (&record.turns, &record.clouds));
        assert_eq!(back.counts, record.counts);

        let torn = PoseRecord { offsets: vec![0, 2, 9], ..record };
        let message = decode_pose(&encode_pose(&torn).unwrap()).unwrap_err().to_string();
        assert!(message.contains("do not fill its 3 rows"), "{message}");
    }

    #[test]
    fn damaged_bytes_are_an_error() {
        let bytes = encode_clouds(&[vec![0.5; 3 * CLOUD]]).unwrap();
        assert!(decode_clouds(&bytes[..bytes.len() - 9]).is_err() && decode_clouds(b"{}").is_err());
    }
}
