/* Functions of numba's runtime that kernels call: reference-counted memory, laid out as by numba 0.6x, and reshape. */
#include <stdint.h>
#include <stdlib.h>

#define HIDDEN __attribute__((visibility("hidden")))

typedef struct {
    size_t references;
    void (*end)(void *, size_t, void *);
    void *end_of, *data;
    size_t size;
    void *allocator;
} Block;

HIDDEN Block *NRT_MemInfo_alloc_aligned(size_t size, unsigned align) {
    if (align < 16) align = 16;
    Block *b = malloc(sizeof *b + size + align);
    if (!b) return 0;
    uintptr_t place = ((uintptr_t)(b + 1) + align - 1) & ~(uintptr_t)(align - 1);
    *b = (Block){1, 0, 0, (void *)place, size, 0};
    return b;
}

HIDDEN void NRT_MemInfo_call_dtor(Block *b) {
    if (b->end) b->end(b->data, b->size, b->end_of);
    free(b);
}

/* For contiguous arrays, the only ones that kernels reshape; 0 makes numba raise. */
HIDDEN int numba_attempt_nocopy_reshape(intptr_t n, const intptr_t *shape, const intptr_t *strides, intptr_t wanted_n,
                                        const intptr_t *wanted, intptr_t *to, intptr_t item, int columns_first) {
    intptr_t size = 1, wanted_size = 1, step = item;
    for (intptr_t i = 0; i < wanted_n; i++) wanted_size *= wanted[i];
    for (intptr_t i = n - 1; i >= 0; i--) {
        if (shape[i] != 1 && strides[i] != item * size && wanted_size) return 0;
        size *= shape[i];
    }
    if (size != wanted_size || columns_first) return 0;
    for (intptr_t i = wanted_n - 1; i >= 0; i--) {
        to[i] = step;
        step *= wanted[i];
    }
    return 1;
}
