"""A compensator of any order over a kick: its exact states and output."""

ORDER = 4  # highest order of a compensator
FORM, KICK = 25, 25
FEED = 4  # where the second axis of the latter begins
WORK, TERM, SUM, NEXT = 64, 40, 44, 48
TERMS = 16  # of a series for exp(x) at |x| <= 1/2: the next is below 1e-19


def exponential(form, n, i, h, e, at):
    """State of one axis after a time h under a held force, z+ = Phi z + Gamma f.

    The series of exp(A h), scaled and squared (Moler, Van Loan, SIAM Review 45, 2003, method 3).
    form: `form_numbers` of both axes, n: highest order of the two. e, shape (WORK,), receives Phi,
    row by row, and Gamma from index `at` on; its end is working space.
    """
    a, b, gamma = FORM * i, FORM * i + 16, at + 16
    size, halvings = 0.0, 0
    for r in range(n):
        row = 0.0
        for c in range(n):
            row += abs(form[a + 4 * r + c])
        size = max(size, row * h)
    while size > 0.5:
        size, h, halvings = 0.5 * size, 0.5 * h, halvings + 1
    for c in range(n + 1):  # columns of Phi, then Gamma
        for r in range(n):
            first = h * form[b + r] if c == n else 1.0 if r == c else 0.0
            e[TERM + r] = first
            e[SUM + r] = first
        for k in range(1, TERMS):
            share = h / (k + 1) if c == n else h / k
            for r in range(n):
                x = 0.0
                for j in range(n):
                    x += form[a + 4 * r + j] * e[TERM + j]
                e[NEXT + r] = x * share
            for r in range(n):
                e[TERM + r] = e[NEXT + r]
                e[SUM + r] += e[NEXT + r]
        for r in range(n):
            e[gamma + r if c == n else at + 4 * r + c] = e[SUM + r]
    for _ in range(halvings):
        double_time(n, e, at)


def double_time(n, e, at):
    """Doubles the time of `exponential`: Gamma += Phi Gamma, then Phi = Phi Phi."""
    gamma = at + 16
    for c in range(n + 1):
        for r in range(n):
            x = e[gamma + r] if c == n else 0.0
            for j in range(n):
                x += e[at + 4 * r + j] * e[gamma + j if c == n else at + 4 * j + c]
            e[NEXT + 4 * r + c if c < n else TERM + r] = x
    for r in range(n):
        e[gamma + r] = e[TERM + r]
        for c in range(n):
            e[at + 4 * r + c] = e[NEXT + 4 * r + c]


def form_kick(form, n, i, before, after, e, out):
    """Numbers of one axis for a kick that evaluates delta at the sample.

    Exact for arbitrarily fast poles: delta = row z + feed f at the sample, and z+ = Phi z + Gamma f
    over the kick. Between equal steps the force is held. Between unequal ones (at a border, a start
    or an end) it is one impulse at the sample, as for the handle. A step gives half of its force to
    each end, so a force held over an uneven kick would have a timing error of first order. delta
    then counts the impulse by the share of the kick after the sample.

    e: as in `exponential`; out receives row (4), feed, Phi (16) and Gamma (4) of each axis.
    """
    exponential(form, n, i, 0.5 * before, e, 0)
    exponential(form, n, i, 0.5 * after, e, 20)
    b, c, o = FORM * i + 16, FORM * i + 20, KICK * i
    uneven, H = before != after, 0.5 * (before + after)
    feed = form[c + 4]
    for r in range(n):
        feed += form[c + r] * (0.5 * after * form[b + r] if uneven else e[16 + r])
        row, gamma = 0.0, 0.0 if uneven else e[36 + r]
        for j in range(n):
            row += form[c + j] * e[4 * j + r]
            gamma += e[20 + 4 * r + j] * (H * form[b + j] if uneven else e[16 + j])
            x = 0.0
            for k in range(n):
                x += e[20 + 4 * r + k] * e[4 * k + j]
            out[o + 5 + 4 * r + j] = x
        out[o + r], out[o + 21 + r] = row, gamma
    out[o + FEED] = feed
