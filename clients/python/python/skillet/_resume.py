"""The search of a stored session, told its trials again."""

import numpy as np

from ._search import Search
from ._session import Session, SessionError


def resume(session: Session) -> Search:
    """See `Session.search`."""
    settings = session.learner["search"]
    if session.wishes:
        raise SessionError(f"{session.file}: its trials were proposed under a wish (--where), which only the tool can "
                           "retell: resume it with `skillet learn`")
    if session.ratings or session._n_added:
        raise SessionError(f"{session.file}: people rated its trials or added a demonstration, which only the tool can "
                           "retell: resume it with `skillet learn`")
    search = Search._as_configured(session.learner, _demonstrations(session))
    trials = session.trials
    rollouts, after = trials["rollout"].tolist(), trials["asked_after"].tolist()
    # In flight, but of no influence on any trial: the resumed search proposes these again.
    in_flight = [(rollout, known) for rollout, known in session._in_flight if rollout < max(rollouts, default=0)]
    asked: dict[int, int] = {**dict(zip(rollouts, after)), **dict(in_flight)}
    order, proposed = iter(sorted(asked)), {}
    next_asked = next(order, None)
    for place, i in enumerate([*np.argsort(trials["told"]).tolist(), None]):
        while next_asked is not None and asked[next_asked] <= place:
            proposed[next_asked] = search.ask()
            next_asked = next(order, None)
        if i is None:
            break
        rollout = rollouts[i]
        trial = proposed.get(rollout)
        if trial is None or trial.rollout != rollout or trial.theta.tobytes() != session.theta[i].tobytes():
            known = " (aim used the task's prediction: set aim.predict = false)" if settings["method"] == "aim" else ""
            raise SessionError(f"{session.file}: rollout {rollout} comes out otherwise here: it was learnt by another "
                               f"version, or with what only the tool knows{known}")
        if trials["set_aside"][i]:
            search.fail(trial, "set aside")
        else:
            measures = {name: values[i] for name, values in session.measures.items() if values[i] == values[i]}
            search.tell(trial, trials["reward"][i], trials["success"][i], measures=measures)
    return search


def _demonstrations(session: Session) -> list[list[str]]:
    if session.learner["action"]["start"]:
        return []
    folder = session.file.parent
    names = ["demonstration.csv", *sorted(path.name for path in folder.glob("demonstration-*.csv"))]
    if not (folder / names[0]).is_file():
        raise SessionError(f"{folder / names[0]}: the session's demonstration is missing: keep its whole folder")
    return [[name, (folder / name).read_text(encoding="utf-8")] for name in names]
