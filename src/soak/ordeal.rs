//! The services of a cell that are killed, alone and together.

/// A service of a cell; the order is that in which they are started.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Role {
    Controller,
    Plant,
    Learner,
}

/// Services that are killed at once.
pub type Kill = &'static [Role];

/// A cell, by what is killed in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ordeal {
    /// Controller and learner.
    Both,
    /// The learner alone: its controller lives on and is watched for leaks.
    Learner,
    /// The plant in another process, its controller, both at once, and the learner beside them.
    Plant,
}

impl Role {
    pub fn name(self) -> &'static str {
        match self {
            Role::Controller => "controller",
            Role::Plant => "plant",
            Role::Learner => "learner",
        }
    }

    /// What a service tells its manager once it does its work.
    pub fn when_up(self) -> &'static str {
        match self {
            // A plant has been let in by the controller.
            Role::Controller | Role::Plant => "READY=1",
            // A learner has found its controller.
            Role::Learner => "STATUS=learning",
        }
    }
}

/// As "controller+plant".
pub fn kill_name(kill: &[Role]) -> String {
    kill.iter().map(|role| role.name()).collect::<Vec<_>>().join("+")
}

impl Ordeal {
    pub const ALL: [Ordeal; 3] = [Ordeal::Both, Ordeal::Learner, Ordeal::Plant];

    pub fn name(self) -> &'static str {
        match self {
            Ordeal::Both => "both",
            Ordeal::Learner => "learner",
            Ordeal::Plant => "plant",
        }
    }

    pub fn title(self) -> &'static str {
        match self {
            Ordeal::Both => "controller and learner killed",
            Ordeal::Learner => "learner killed, controller left alone",
            Ordeal::Plant => "plant in another process: plant, controller and learner killed",
        }
    }

    /// What runs in the cell.
    pub fn services(self) -> &'static [Role] {
        match self {
            Ordeal::Both | Ordeal::Learner => &[Role::Controller, Role::Learner],
            Ordeal::Plant => &[Role::Controller, Role::Plant, Role::Learner],
        }
    }

    /// What happens to them, each as often as the others.
    pub fn kills(self) -> &'static [Kill] {
        match self {
            Ordeal::Both => {
                &[&[Role::Controller], &[Role::Learner], &[Role::Controller, Role::Learner]]
            }
            Ordeal::Learner => &[&[Role::Learner]],
            Ordeal::Plant => &[
                &[Role::Plant],
                &[Role::Controller],
                &[Role::Controller, Role::Plant],
                &[Role::Learner],
            ],
        }
    }

    pub fn has_plant(self) -> bool {
        self.services().contains(&Role::Plant)
    }

    /// It is never killed.
    pub fn spares(self, role: Role) -> bool {
        !self.kills().iter().any(|kill| kill.contains(&role))
    }
}
