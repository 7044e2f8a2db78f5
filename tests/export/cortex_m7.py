"""A program that steps an exported law on a bare Cortex-M7, as QEMU's board MPS2 AN500 has it.

It reads inputs from `in.bin` and writes what comes out to `out.bin`, by semihosting (Arm's
"Semihosting for AArch32 and AArch64", calls 1, 5, 6 and 0x18). There is no C library.
"""

import subprocess
import sys
from pathlib import Path

BOARD = "qemu-system-arm"
TARGET = "-target thumb-freestanding-eabihf -mcpu=cortex_m7+fp_armv8d16"
RUN = "-M mps2-an500 -cpu cortex-m7 -nographic -semihosting -kernel m7.elf"
FILES = {
    "m7.c": """
#include <stdint.h>
#include "law.h"

extern char stack_top[];
static podusv_law law;

double fmin(double a, double b) { return a < b ? a : b; }
double fmax(double a, double b) { return a > b ? a : b; }
double __floatdidf(long long whole) { return (double)whole; } /* libgcc has it */

static int host(int what, uint32_t *with)
{
    register int r0 __asm__("r0") = what;
    register uint32_t *r1 __asm__("r1") = with;
    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

static int opened(const char *name, int mode, int length)
{
    return host(1, (uint32_t[]){(uint32_t)name, mode, length});
}

static int moved(int what, int file, const void *data, int count)
{
    return host(what, (uint32_t[]){file, (uint32_t)data, count});
}

__attribute__((noinline)) static void steps(void)
{
    double in[9 + PODUSV_LAW_TARGET], demand[PODUSV_LAW_DEMAND];
    int from = opened("in.bin", 1, 6), to = opened("out.bin", 5, 7);

    podusv_law_start(&law);
    while (moved(6, from, in, sizeof in) == 0) {
        podusv_law_step(&law, in, in + 6, in + 6 + PODUSV_LAW_TARGET, demand);
        moved(5, to, demand, sizeof demand);
        moved(5, to, podusv_law_signals(&law), 8 * PODUSV_LAW_SIGNALS);
        moved(5, to, podusv_law_memory(&law), 8 * PODUSV_LAW_MEMORY);
    }
    host(0x18, (uint32_t *)0x20026);
}

void _start(void)
{
    *(volatile uint32_t *)0xE000ED88 |= 0xF << 20; /* the floating-point unit is off at reset */
    __asm__ volatile("dsb\\nisb");
    steps();
    for (;;) { }
}

__attribute__((section(".vectors"), used)) static void *const vectors[] = {stack_top, _start};
""",
    "m7.ld": """
MEMORY { code : ORIGIN = 0, LENGTH = 4M  ram : ORIGIN = 0x20000000, LENGTH = 4M }
SECTIONS {
  .text : { KEEP(*(.vectors)) *(.text*) *(.rodata*) } > code
  .data : { *(.data*) *(.bss*) *(COMMON) } > ram
  /DISCARD/ : { *(.ARM.ex*) }
  stack_top = 0x20400000;
}
""",
    "math.h": """
double fmin(double, double);
double fmax(double, double);
#define NAN __builtin_nan("")
#define INFINITY __builtin_inf()
""",
    "string.h": """
#include <stddef.h>
void *memcpy(void *, const void *, size_t);
void *memset(void *, int, size_t);
""",
}


def stepped(folder: Path, inputs: bytes) -> bytes:
    """What the law in an exported folder makes of rows of inputs."""
    for name, text in FILES.items():
        (folder / name).write_text(text)
    (folder / "in.bin").write_bytes(inputs)
    linked = f"cc {TARGET} -O2 -ffp-contract=off -ffreestanding -I. -T m7.ld -o m7.elf m7.c law.c"
    compiler = [sys.executable, "-m", "ziglang", *linked.split(), "thumbv7em/law.o"]
    subprocess.run(compiler, cwd=folder, check=True)
    subprocess.run(
        [BOARD, *RUN.split()], cwd=folder, check=True, timeout=120, stdin=subprocess.DEVNULL
    )
    return (folder / "out.bin").read_bytes()
