from fmus.kernels.jit import kernel


@kernel
def acceleration(x, v, k, c, f):
    return f - k * x - c * v


@kernel
def advance(state, n, h, k, c, f):
    """Integrate by velocity Verlet, n steps of length h; state = (x, v, steps done as a float)."""
    x, v = state[0], state[1]
    for _ in range(n):
        v += 0.5 * h * acceleration(x, v, k, c, f)
        x += h * v
        v += 0.5 * h * acceleration(x, v, k, c, f)
    state[0], state[1] = x, v
