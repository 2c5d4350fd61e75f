/* Preloaded library that counts allocations of a process and prints their number when it ends. Needs glibc. */
#include <stddef.h>
#include <stdio.h>

extern void *__libc_malloc(size_t), *__libc_calloc(size_t, size_t), *__libc_realloc(void *, size_t);
extern void *__libc_memalign(size_t, size_t);
static unsigned long count;

void *malloc(size_t size) {
    count++;
    return __libc_malloc(size);
}

void *calloc(size_t items, size_t size) {
    count++;
    return __libc_calloc(items, size);
}

void *realloc(void *old, size_t size) {
    count++;
    return __libc_realloc(old, size);
}

void *aligned_alloc(size_t align, size_t size) {
    count++;
    return __libc_memalign(align, size);
}

int posix_memalign(void **to, size_t align, size_t size) {
    count++;
    *to = __libc_memalign(align, size);
    return *to ? 0 : 12;
}

__attribute__((destructor)) static void print_count(void) { fprintf(stderr, "allocations %lu\n", count); }
