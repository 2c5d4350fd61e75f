"""Copy of row words into message records; numpy would need two copies and Python's lock."""

from numba.extending import register_jitable

from orchestrator.kernels.intrinsics import load_word, store_word


@register_jitable
def copy_words(rows, width, chosen, n, moves, n_moves, records, size):
    """Copy words of n chosen rows into n records; arguments are addresses, counts and sizes in bytes.

    ``rows``: address of row 0, ``width`` bytes per row; ``chosen``: row numbers; ``moves``: pairs of a byte offset from
    the beginning of the row, possibly negative, and a byte offset in the record; where two moves overlap the later one
    wins; ``records``: address of record 0, ``size`` bytes per record.
    """
    for i in range(n):
        row = rows + width * load_word(chosen + 8 * i)
        record = records + size * i
        for k in range(n_moves):
            move = moves + 16 * k
            store_word(record + load_word(move + 8), load_word(row + load_word(move)))
    return 0
