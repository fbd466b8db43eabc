//! The network that runs and its twin that trains, on states of a dataset.

use dataset::generate::{Alone, built_in_objects};
use dataset::{Dataset, DatasetConfig};
use grasps::Robot;
use imitation::encoder::TrainedEncoder;
use imitation::nn::Params;
use imitation::nn::network::{self, Network};
use imitation::split;
use policy::model::ModelConfig;
use policy::weights::Tensors;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use robot::{DOF, JointState};

/// States that are compared.
const STATES: usize = 1000;

#[test]
fn twins_agree_on_a_thousand_states_of_a_dataset() {
    let folder = tempfile::tempdir().unwrap();
    let robot = Robot::standard().unwrap();
    let config = DatasetConfig::preset("smoke", 3).unwrap();
    let objects = built_in_objects(config.all_objects()).unwrap();
    let dataset = Dataset::create(&folder.path().join("data"), config, &objects, false).unwrap();
    dataset.generate(&robot, &objects, &Alone).unwrap();

    let weights = include_bytes!("../../models/default/weights.safetensors");
    let config = ModelConfig::parse(include_bytes!("../../models/default/config.json")).unwrap();
    let encoder = TrainedEncoder::of_model(weights).unwrap();
    let mut params = Params::default();
    network::init(&mut params, &config.policy, &mut ChaCha8Rng::seed_from_u64(0)).unwrap();
    params.restore(weights).unwrap();
    let limits = &robot.tree.limits;
    let twin = Network::new(&config.policy, limits).unwrap();
    let runs = policy::Network::load(&Tensors::parse(weights).unwrap(), &config.policy, limits);
    let runs = runs.unwrap();

    let observation = config.policy.observation;
    let (taught, held_out) = split::lessons(&dataset, &encoder, observation, 3).unwrap();
    let mut compared = 0;
    let mut greatest = 0.0f64;
    for lesson in taught.iter().chain(&held_out) {
        let object = &lesson.encodings[0];
        let rows = lesson.demonstrations.rows();
        let states: Vec<JointState> = (0..rows)
            .step_by(2)
            .map(|row| object.state_in_front(&lesson.demonstrations.state(row)))
            .collect();
        let z = vec![object.z.as_slice(); states.len()];
        let got = twin.respond(&params, &states, &z).unwrap().accelerations;
        for (state, got) in states.iter().zip(got.to_vec2::<f32>().unwrap()) {
            let wanted = runs.acceleration(state, &object.z).unwrap();
            let off = (0..DOF).map(|i| (f64::from(got[i]) - wanted[i]).abs()).fold(0.0, f64::max);
            greatest = greatest.max(off / wanted.norm());
            compared += 1;
        }
    }
    assert!(compared >= STATES, "{compared} states");
    assert!(greatest < 1e-4, "they differ by {greatest} of the acceleration's norm");
}
