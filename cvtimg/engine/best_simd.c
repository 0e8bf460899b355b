/* Prints the best instruction set of this machine that nearest.h knows, for meson.build. */
#include <stdio.h>

int main(void)
{
    __builtin_cpu_init();
    int avx512 = __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
                 __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl");
    int avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");

    return fputs(avx512 ? "avx512" : avx2 ? "avx2" : "baseline", stdout) < 0;
}
