-- A session: everything needed to resume it, readable with any SQLite tool.
-- θ, mean and std are BLOBs of little-endian f64 in scaled units (path: f32, 20 columns a row).
-- seal: digest of all other columns of the row (see `seal.rs`).
-- 64-bit identities (session, boot, digest) are hexadecimal text: SQLite's integers are signed.

CREATE TABLE meta (
    key TEXT PRIMARY KEY,
    seal INTEGER,
    value TEXT NOT NULL
) STRICT;

CREATE TABLE policies (
    policy_id INTEGER PRIMARY KEY,
    seal INTEGER,
    kind TEXT NOT NULL CHECK (kind IN ('initial', 'trial', 'mode')),
    rollout INTEGER NOT NULL,
    digest TEXT NOT NULL,
    message TEXT NOT NULL
) STRICT;

-- Written before the policy is published.
CREATE TABLE proposals (
    rollout INTEGER PRIMARY KEY,
    seal INTEGER,
    theta BLOB NOT NULL
) STRICT;

CREATE TABLE trials (
    rollout INTEGER PRIMARY KEY REFERENCES proposals (rollout),
    seal INTEGER,
    theta BLOB NOT NULL,
    reward REAL NOT NULL,
    success INTEGER NOT NULL,
    -- 1: it gave no usable episode; the search was not told.
    set_aside INTEGER NOT NULL,
    policy_id INTEGER NOT NULL REFERENCES policies (policy_id),
    policy_digest TEXT NOT NULL,
    boot_id TEXT NOT NULL,
    applied_tick INTEGER NOT NULL,
    fault INTEGER NOT NULL,
    n_records INTEGER NOT NULL,
    path BLOB NOT NULL
) STRICT;

-- What was measured of a trial; none where nothing was executed. Names and units, in order, are
-- `measures` in meta.
CREATE TABLE measures (
    rollout INTEGER NOT NULL REFERENCES trials (rollout),
    name TEXT NOT NULL,
    seal INTEGER,
    value REAL NOT NULL,
    PRIMARY KEY (rollout, name)
) STRICT;

-- The state of the search after a trial: the distribution of the next proposal.
CREATE TABLE searches (
    rollout INTEGER PRIMARY KEY REFERENCES trials (rollout),
    seal INTEGER,
    mean BLOB NOT NULL,
    std BLOB NOT NULL,
    floor REAL NOT NULL
) STRICT;

-- What the search has found, written when it stops: mean and covariance in scaled units, the latter
-- by columns. All of it follows from the trials.
CREATE TABLE modes (
    mode INTEGER PRIMARY KEY,
    seal INTEGER,
    prior REAL NOT NULL,
    mean BLOB NOT NULL,
    covariance BLOB NOT NULL,
    policy_id INTEGER NOT NULL REFERENCES policies (policy_id),
    trials INTEGER NOT NULL,
    best_rollout INTEGER,
    best_reward REAL,
    tolerance REAL
) STRICT;

-- Means of modes that must not be used.
CREATE TABLE forbidden (
    id INTEGER PRIMARY KEY,
    seal INTEGER,
    mean BLOB NOT NULL
) STRICT;

-- What a success must be like beside succeeding, from the trial after `after` on; nothing where empty.
CREATE TABLE wishes (
    after INTEGER PRIMARY KEY,
    seal INTEGER,
    text TEXT NOT NULL
) STRICT;

-- What people said of trials, in the order in which it took effect: a rating from 0 to 10, or none any more. The
-- proposals after trial `after` know of it. `letter` is the message that said it.
CREATE TABLE ratings (
    id INTEGER PRIMARY KEY,
    seal INTEGER,
    letter TEXT NOT NULL,
    after INTEGER NOT NULL,
    rollout INTEGER NOT NULL REFERENCES trials (rollout),
    rating REAL
) STRICT;

-- Demonstrations that were added: starts of the search from the trial after `after` on.
CREATE TABLE demonstrations (
    id INTEGER PRIMARY KEY,
    seal INTEGER,
    letter TEXT NOT NULL,
    after INTEGER NOT NULL,
    file TEXT NOT NULL,
    text TEXT NOT NULL
) STRICT;

-- How many trials the search knew when it proposed a rollout. Where there is no row: all before it, as in a
-- session whose rollouts were in flight one at a time.
CREATE TABLE asked (
    rollout INTEGER PRIMARY KEY REFERENCES proposals (rollout),
    seal INTEGER,
    after INTEGER NOT NULL
) STRICT;

-- In which order trials were told, from 1, and which cell executed them. Where there is no row: in the order
-- of their rollouts.
CREATE TABLE told (
    place INTEGER PRIMARY KEY,
    seal INTEGER,
    rollout INTEGER NOT NULL UNIQUE REFERENCES trials (rollout),
    cell TEXT NOT NULL
) STRICT;

-- Which cell a rollout was given to last. Where there is no row: to the only one.
CREATE TABLE given (
    rollout INTEGER PRIMARY KEY REFERENCES proposals (rollout),
    seal INTEGER,
    cell TEXT NOT NULL
) STRICT;

-- What a cell drives, from the trial that was told as number `since` on: name of the robot in its URDF, SHA-256 of
-- that file, and the plant. Where there is no row nothing was told.
CREATE TABLE cells (
    cell TEXT NOT NULL,
    since INTEGER NOT NULL,
    seal INTEGER,
    arm TEXT NOT NULL,
    urdf_sha256 TEXT NOT NULL,
    plant TEXT NOT NULL,
    PRIMARY KEY (cell, since)
) STRICT;

CREATE TABLE events (
    id INTEGER PRIMARY KEY,
    seal INTEGER,
    kind TEXT NOT NULL,
    text TEXT NOT NULL
) STRICT;
