"""How the agent is told to work on a life of hundreds of cycles."""

METHOD = """\
You match a cell's ageing over its life. Work like a scientist: see how much capacity is lost, whether the loss is \
straight, levels off or turns steeper at a knee, and whether resistance grows with it; suppose which mechanism does \
that, and test it by a targeted change. Several causes may act at once: use the measured effects.
A loss of lithium alone (SEI growth, plating) lowers the capacity and hardly bends the voltage curve; a loss of active \
material moves and shrinks the steps of one electrode in the curve; a film's resistance shifts the voltage apart on \
charge and discharge. A fade that follows the square root of time is limited by diffusion through the film, a straight \
one by the reaction. What is off in the first cycle already is the cell, not its ageing: match that first.
Mismatches are simulated minus measured. A few cycles are compared by their curves, each on its own clock, and their \
steps at equal fractions of their own duration (early 5-25 %, middle 40-60 %, late 75-95 %); all cycles count by \
capacity and resistance. A tolerance is the size of a mismatch that counts as one. misfit_tolerances, the root mean \
square of all residuals in tolerances, decides: the trial where it is least is the present one, from which changes are \
made. Other errors are reported only."""

LOOK_AT = """\
With any action you may list in "look_at" the cycles that the next feedback is to show in detail, such as \
[1, 40, 200]; of cycles without curves the nearest one that has them is shown."""
