//! What is remembered is what comes back; what is broken is named and costs nothing else.

use std::fs;

use super::*;
use crate::executor::latch::Latched;
use crate::fault::Fault;

fn policy(damping: f64) -> PolicyMsg {
    let mut policy = PolicyMsg { n_components: 1, damping, ..PolicyMsg::EMPTY };
    policy.components[0].attractor = [0.1 + 0.2, 1.0 / 3.0, 0.72, 0.0, 0.0, 0.0];
    policy.components[0].stiffness[..6].copy_from_slice(&[200.0, 1.5, 210.0, 0.0, 0.0, 220.0]);
    policy.sealed()
}

fn import(catalogue: &mut Catalogue, damping: f64) -> PolicyName {
    assert!(catalogue.import(&policy(damping)).unwrap().is_some(), "it is written");
    catalogue.numbered(policy(damping).digest)
}

struct Dir(PathBuf);

impl Dir {
    fn new(name: &str) -> Dir {
        Dir(std::env::temp_dir().join(format!("skillet-{name}-{}", std::process::id())))
    }
}

impl Drop for Dir {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

#[test]
fn a_restart_finds_what_was_remembered_bit_for_bit() {
    let dir = Dir::new("restart");
    let good = PolicyMsg { session: u64::MAX, rollout: 31, policy_id: 31, ..policy(9.0) };
    let latched = Some(Latched { fault: Fault::MeasurementStale, since_unix_s: 1234 });
    {
        let mut catalogue = Catalogue::open(Some(&dir.0)).unwrap();
        assert!(catalogue.left().active.is_none() && catalogue.left().last_good.is_none());
        let ids = [1.0, 2.0, 1.0].map(|damping| import(&mut catalogue, damping).policy_id);
        assert_eq!(ids, [1, 2, 1]);
        catalogue.forbid(1, true).unwrap();
        let active = Some(catalogue.name(2));
        catalogue.remember(Remember { active, last_good: Some(&good), pinned: true, latched });
    }
    let mut catalogue = Catalogue::open(Some(&dir.0)).unwrap();
    assert_eq!(catalogue.left().last_good, Some(good));
    assert_eq!(catalogue.left().active, Some(PolicyMsg { policy_id: 2, ..policy(2.0) }));
    assert!(catalogue.left().pinned);
    assert_eq!(catalogue.left().latched, latched, "a restart does not re-arm");
    assert!(matches!(catalogue.get(1), Err(CatalogueError::Forbidden(1))));
    catalogue.forbid(1, false).unwrap();
    assert_eq!(catalogue.get(1).unwrap().digest, policy(1.0).digest);
    assert!(matches!(catalogue.get(3), Err(CatalogueError::Unknown(3))));
    assert_eq!(import(&mut catalogue, 3.0).policy_id, 3);
}

#[test]
fn the_last_good_policy_of_a_session_may_be_the_active_one() {
    let dir = Dir::new("good");
    let good = PolicyMsg { session: 5, rollout: 31, policy_id: 31, ..policy(9.0) };
    {
        let mut catalogue = Catalogue::open(Some(&dir.0)).unwrap();
        let active = Some(good.name());
        catalogue.remember(Remember {
            active,
            last_good: Some(&good),
            pinned: false,
            latched: None,
        });
    }
    let catalogue = Catalogue::open(Some(&dir.0)).unwrap();
    assert_eq!(catalogue.left().active, Some(good));
}

#[test]
fn a_broken_policy_is_left_out_and_a_broken_state_is_named() {
    let dir = Dir::new("broken");
    {
        let mut catalogue = Catalogue::open(Some(&dir.0)).unwrap();
        for damping in [1.0, 2.0] {
            import(&mut catalogue, damping);
        }
        catalogue.remember(Remember {
            active: None,
            last_good: None,
            pinned: false,
            latched: None,
        });
    }
    let first = dir.0.join("policies/1.json");
    let text = fs::read_to_string(&first).unwrap();
    fs::write(&first, &text[..text.len() / 2]).unwrap();
    let mut catalogue = Catalogue::open(Some(&dir.0)).unwrap();
    assert!(matches!(catalogue.get(1), Err(CatalogueError::Unknown(1))));
    assert_eq!(import(&mut catalogue, 3.0).policy_id, 3, "1 is never given again");
    drop(catalogue);

    let state = dir.0.join(STATE_FILE);
    for broken in ["", "{", "{\"format\": 9}", "[]"] {
        fs::write(&state, broken).unwrap();
        let error = Catalogue::open(Some(&dir.0)).err().unwrap().to_string();
        assert!(error.contains("state.json") && error.contains("move it away"), "{error}");
    }
}
