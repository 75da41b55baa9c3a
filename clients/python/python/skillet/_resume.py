"""The search of a stored session, told its trials again."""

from pathlib import Path

from ._search import Search
from ._session import Session, SessionError


def resume(session: Session) -> Search:
    """See `Session.search`."""
    settings = session.learner["search"]
    if session.wishes:
        raise SessionError(f"{session.file}: its trials were proposed under a wish (--where), which only the tool can "
                           "retell: resume it with `skillet learn`")
    search = Search.__new__(Search)
    search._begin(_origin(session))
    trials = session.trials
    for i, rollout in enumerate(trials["rollout"].tolist()):
        trial = search.ask()
        if trial.rollout != rollout or trial.theta.tobytes() != session.theta[i].tobytes():
            known = " (aim used the task's prediction: set aim.predict = false)" if settings["method"] == "aim" else ""
            raise SessionError(f"{session.file}: rollout {rollout} comes out otherwise here: it was learnt by another "
                               f"version, or with what only the tool knows{known}")
        if trials["set_aside"][i]:
            search.fail(trial, "set aside")
        else:
            measures = {name: values[i] for name, values in session.measures.items() if values[i] == values[i]}
            search.tell(trial, trials["reward"][i], trials["success"][i], measures=measures)
    return search


def _origin(session: Session) -> dict:
    learner = session.learner
    start = learner["action"]["start"]
    if start:
        low, high, unit = (learner["action"].get(key) or None for key in ("min", "max", "unit"))
        along = unit and [[value * (i == k) for k in range(len(unit))] for i, value in enumerate(unit)]
        return {"search": learner["search"], "seed": learner["seed"], "start": start, "low": low, "high": high,
                "directions": along}
    folder = session.file.parent
    names = ["demonstration.csv", *sorted(path.name for path in folder.glob("demonstration-*.csv"))]
    files = [Path(folder, name) for name in names]
    if not files[0].is_file():
        raise SessionError(f"{files[0]}: the session's demonstration is missing: keep its whole folder")
    return {"learner": learner, "demonstrations": [[file.name, file.read_text(encoding="utf-8")] for file in files]}
