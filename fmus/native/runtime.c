/* Functions of numba's runtime that kernels call: reference-counted memory, laid out as by numba 0.6x. */
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
