/* Whether processor and operating system support x86-64-v3: System V ABI, AMD64 supplement, 3.1.1. */
#include <cpuid.h>
#include <stdint.h>

#define HIDDEN __attribute__((visibility("hidden")))

HIDDEN int wide_processor(void) {
#ifndef ONLY_ANY_PROCESSOR /* defined by tests of the other half of a library */
    const unsigned fma = 1u << 12, movbe = 1u << 22, osxsave = 1u << 27, avx = 1u << 28, f16c = 1u << 29; /* leaf 1, c */
    const unsigned bmi1 = 1u << 3, avx2 = 1u << 5, bmi2 = 1u << 8;                                     /* leaf 7, b */
    const unsigned lzcnt = 1u << 5;                                                           /* leaf 0x80000001, c */
    const unsigned first = fma | movbe | osxsave | avx | f16c, second = bmi1 | avx2 | bmi2, kept = 6; /* by the system */
    unsigned a, b, c, d, low, high;
    if (!__get_cpuid(1, &a, &b, &c, &d) || (c & first) != first) return 0;
    __asm__("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
    if ((low & kept) != kept) return 0;
    if (!__get_cpuid_count(7, 0, &a, &b, &c, &d) || (b & second) != second) return 0;
    return __get_cpuid(0x80000001u, &a, &b, &c, &d) && (c & lzcnt);
#else
    return 0;
#endif
}
