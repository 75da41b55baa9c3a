//! Names, roles and locks of a cell.

use super::*;

#[test]
fn refuses_names_that_would_escape_the_runtime_directory() {
    for name in ["", "../x", "a/b", "Upper", "with space", &"x".repeat(25)] {
        assert!(matches!(Cell::new(name), Err(CellError::Name(_))), "{name}");
    }
}

#[test]
fn the_longest_cell_has_room_for_every_channel() {
    use crate::channel::ChannelError;
    use crate::ports::{ControllerPorts, LearnerPorts};
    let dir = format!("/tmp/sk{}", "x".repeat(MAX_DIR_LEN - 8 - 24));
    let cell = Cell::in_dir(Path::new(&dir), &"y".repeat(24)).unwrap();
    assert_eq!(cell.dir.as_os_str().len(), MAX_DIR_LEN);
    let lock = cell.lock(Role::Controller).unwrap();
    // Sockets are named by random numbers of up to 31 digits.
    for _ in 0..20 {
        let controller = ControllerPorts::create(&cell).unwrap();
        let soon = std::time::Duration::from_secs(5);
        let learner: Result<_, ChannelError> = LearnerPorts::open(&cell, soon, &|| false);
        drop((learner.unwrap(), controller));
    }
    drop(lock);
    assert_eq!(cell.traces(), Vec::<PathBuf>::new());
    fs::remove_dir(&dir).unwrap();
}

#[test]
fn a_cell_knows_the_session_of_its_learner_until_it_is_removed() {
    let cell = Cell::new(&format!("told-{}", std::process::id())).unwrap();
    assert_eq!(cell.session(), None);
    let lock = cell.lock(Role::Learner).unwrap();
    for folder in ["/a/session", "/another one/of üse"] {
        cell.tell_session(Path::new(folder)).unwrap();
        assert_eq!(cell.session(), Some(PathBuf::from(folder)));
    }
    drop(lock);
    assert_eq!((cell.session(), cell.traces()), (None, Vec::new()));
}

#[test]
fn roles_that_start_together_do_not_refuse_each_other() {
    for round in 0..50 {
        let cell = Cell::new(&format!("both-{}-{round}", std::process::id())).unwrap();
        std::thread::scope(|scope| {
            let cell = &cell;
            let roles = [Role::Controller, Role::Learner];
            let locks = roles.map(|role| scope.spawn(move || cell.lock(role)));
            let locks = locks.map(|lock| lock.join().unwrap().unwrap());
            drop(locks);
        });
        cell.remove_if_idle();
    }
}

#[test]
fn those_who_look_refuse_nobody() {
    let cell = Cell::new(&format!("look-{}", std::process::id())).unwrap();
    drop(cell.lock(Role::Learner).unwrap());
    let is_over = std::sync::atomic::AtomicBool::new(false);
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                while !is_over.load(std::sync::atomic::Ordering::Relaxed) {
                    cell.has(Role::Controller);
                    std::thread::yield_now();
                }
            });
        }
        let locked = (0..200).try_for_each(|_| cell.lock(Role::Controller).map(drop));
        is_over.store(true, std::sync::atomic::Ordering::Relaxed);
        locked.unwrap();
    });
    cell.remove_if_idle();
}

#[test]
fn second_controller_is_refused_until_the_first_ends() {
    let cell = Cell::new(&format!("lock-{}", std::process::id())).unwrap();
    assert!(!cell.has(Role::Controller), "no folder yet");
    let first = cell.lock(Role::Controller).unwrap();
    assert!(cell.has(Role::Controller) && !cell.has(Role::Learner));
    assert!(matches!(cell.lock(Role::Controller), Err(CellError::Busy { .. })));
    let learner = cell.lock(Role::Learner).unwrap();
    drop(first);
    assert!(!cell.has(Role::Controller) && cell.has(Role::Learner));
    drop(cell.lock(Role::Controller).unwrap());
    drop(learner);
    cell.remove_if_idle();
    assert!(!cell.dir.exists());
}
