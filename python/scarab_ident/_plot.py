"""Figure of an identification; needs matplotlib."""

from __future__ import annotations

import numpy as np

from ._native import InputError


def plot(identification, joints, joint=None):
    """Draws measured and predicted torque above their difference, a column for each joint; returns the axes."""
    try:
        from matplotlib import pyplot
    except ImportError as error:
        raise ImportError("plot() needs matplotlib: pip install 'scarab-ident[plot]'") from error
    if joint is not None and joint not in joints:
        raise InputError(f"joint is '{joint}'; the leg has {', '.join(joints)}")
    shown = joints if joint is None else [joint]
    figure, axes = pyplot.subplots(
        2,
        len(shown),
        sharex="col",
        squeeze=False,
        figsize=(6.4 * len(shown), 4.8),
        gridspec_kw={"height_ratios": [2, 1]},
    )
    # Colours of Okabe and Ito (2008), distinct for colour-blind readers.
    measured, predicted, unused = "#000000", "#d55e00", "#0072b2"
    for column, name in enumerate(shown):
        index = joints.index(name)
        torque, residual = axes[0][column], axes[1][column]
        start, labelled = 0.0, set()
        for motion in identification.motions:
            if motion.time_s.size == 0:
                continue
            # Motions follow each other with a gap of a second.
            time = start + motion.time_s - motion.time_s[0]
            start = time[-1] + 1.0
            is_unused = motion.role != "identified from"
            colour = unused if is_unused else predicted
            label = "predicted, unused motion" if is_unused else "predicted"

            def once(text):
                text = None if text in labelled else text
                labelled.add(text)
                return text

            # Friction at rest is undetermined, so such rows are excluded.
            moving = np.where(motion.at_rest[:, index], np.nan, motion.predicted_nm[:, index])
            torque.plot(time, motion.measured_nm[:, index], color=measured, lw=0.8, label=once("measured"))
            torque.plot(time, moving, color=colour, lw=0.8, label=once(label))
            residual.plot(time, motion.measured_nm[:, index] - moving, color=colour, lw=0.8)
        torque.set_title(name)
        torque.set_ylabel("torque [N m]")
        residual.set_ylabel("measured - predicted [N m]")
        residual.set_xlabel("time of the motions, one after the other [s]; gaps: joint at rest")
        residual.axhline(0.0, color="#999999", lw=0.6)
    figure.suptitle(identification.verdict)
    handles, labels = axes[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", ncols=3, frameon=False)
    figure.tight_layout(rect=(0.0, 0.06, 1.0, 1.0))
    return axes
