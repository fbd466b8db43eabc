//! glTF skins (specification, section 3.7.3): each vertex follows up to four joints per set of attributes.
//!
//! The mesh is read in the pose of its nodes; animations are ignored.

use super::accessor::{AccessorView, Buffers};
use super::gltf::malformed;
use crate::{Location, MeshError};
use glamx::DMat4;
use gltf::json::accessor::Type;
use gltf::json::mesh::{Primitive, Semantic};
use gltf::json::validation::Checked;
use gltf::json::{Accessor, Index, Root, Skin};

/// Number of joints per vertex in one set of attributes.
const JOINTS_PER_SET: usize = 4;

/// Transforms `world_from_bind` of the joints of a skin.
///
/// `world_from_node` has the transform of each node of the scene.
pub(super) fn joint_transforms(
    root: &Root,
    buffers: &Buffers,
    index: Index<Skin>,
    world_from_node: &[Option<DMat4>],
) -> Result<Vec<DMat4>, MeshError> {
    let location = Location::Entry("skin", index.value());
    let skin = root
        .get(index)
        .ok_or_else(|| malformed(location, "an existing skin", root.skins.len().to_string()))?;
    let inverse_bind = match skin.inverse_bind_matrices {
        Some(index) => Some(AccessorView::new(root, buffers, index, Type::Mat4)?),
        None => None,
    };
    if let Some(matrices) = inverse_bind.as_ref().filter(|all| all.count < skin.joints.len()) {
        let found = format!("{} for {} joints", matrices.count, skin.joints.len());
        return Err(malformed(location, "an inverse bind matrix per joint", found));
    }
    let transform = |(row, joint): (usize, &Index<_>)| {
        let Some(&Some(world_from_joint)) = world_from_node.get(joint.value()) else {
            let found = format!("node {}", joint.value());
            return Err(malformed(location, "joints in the scene", found));
        };
        let matrix = |view: &AccessorView<'_>| {
            DMat4::from_cols_array(&std::array::from_fn(|i| view.value(row, i)))
        };
        Ok(world_from_joint * inverse_bind.as_ref().map_or(DMat4::IDENTITY, matrix))
    };
    skin.joints.iter().enumerate().map(transform).collect()
}

/// Joints and weights of the vertices of a primitive.
pub(super) struct VertexJoints<'a> {
    sets: Vec<[AccessorView<'a>; 2]>,
    /// Transforms of [`joint_transforms`].
    world_from_bind: &'a [DMat4],
}

impl<'a> VertexJoints<'a> {
    /// Reads the attributes of a primitive with `num_vertices` vertices; `None` if it has none.
    pub(super) fn new(
        root: &Root,
        buffers: &'a Buffers<'a>,
        primitive: &Primitive,
        world_from_bind: &'a [DMat4],
        num_vertices: usize,
    ) -> Result<Option<Self>, MeshError> {
        let mut sets = Vec::new();
        for set in 0.. {
            let attribute = |semantic| primitive.attributes.get(&Checked::Valid(semantic)).copied();
            let (Some(joints), Some(weights)) =
                (attribute(Semantic::Joints(set)), attribute(Semantic::Weights(set)))
            else {
                break;
            };
            let view = |index: Index<Accessor>| {
                let view = AccessorView::new(root, buffers, index, Type::Vec4)?;
                if view.count < num_vertices {
                    let location = Location::Entry("accessor", index.value());
                    let found = format!("{} for {num_vertices} vertices", view.count);
                    return Err(malformed(location, "a value for each vertex", found));
                }
                Ok(view)
            };
            sets.push([view(joints)?, view(weights)?]);
        }
        Ok((!sets.is_empty()).then_some(Self { sets, world_from_bind }))
    }

    /// Weighted mean of the transforms of a vertex's joints.
    pub(super) fn world_from_bind(&self, row: usize) -> Result<DMat4, MeshError> {
        let (mut sum, mut total) = (DMat4::ZERO, 0.0);
        for [joints, weights] in &self.sets {
            for slot in 0..JOINTS_PER_SET {
                let weight = weights.value(row, slot);
                if weight == 0.0 {
                    continue;
                }
                let joint = joints.value(row, slot) as usize;
                let Some(transform) = self.world_from_bind.get(joint) else {
                    let location = Location::Entry("vertex", row);
                    let expected = "a joint of the skin";
                    return Err(malformed(location, expected, joint.to_string()));
                };
                sum += *transform * weight;
                total += weight;
            }
        }
        Ok(if total > 0.0 { sum * (1.0 / total) } else { DMat4::IDENTITY })
    }
}
