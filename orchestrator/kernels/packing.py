"""Words of rows copied into message records: numpy would need two copies for it, and Python's lock."""

from numba.extending import register_jitable

from orchestrator.kernels.intrinsics import load_word, store_word


@register_jitable
def copy_words(rows, width, chosen, n, moves, n_moves, records, size):
    """Copy words of n chosen rows into as many records; addresses, and sizes in bytes.

    ``rows``: address of row 0, ``width`` bytes each; ``chosen``: numbers of rows; ``moves``: pairs (bytes behind the
    beginning of the row, which may be negative, byte of the record), of which the later of two that overlap counts;
    ``records``: address of record 0, ``size`` bytes each.
    """
    for i in range(n):
        row = rows + width * load_word(chosen + 8 * i)
        record = records + size * i
        for k in range(n_moves):
            move = moves + 16 * k
            store_word(record + load_word(move + 8), load_word(row + load_word(move)))
    return 0
