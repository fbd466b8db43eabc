//! Replays the fuzzing corpus.

use std::path::Path;

#[test]
fn targets_accept_all_corpus_files_without_panic() {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus");
    for (name, target) in fuzz::TARGETS {
        let files = std::fs::read_dir(corpus.join(name)).expect("corpus folder");
        let mut count = 0;
        for file in files {
            let path = file.expect("corpus entry").path();
            println!("{}", path.display());
            target(&std::fs::read(&path).expect("readable file"));
            count += 1;
        }
        assert!(count >= 3, "{name} has {count} files");
    }
}
