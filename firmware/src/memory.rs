//! Placement of statics in memory, and stack high-water mark.
//!
//! By default statics are in the tightly coupled memory next to the core, with the stack (`memory.x`). Large ones are placed
//! with [`place!`](crate::place) in `axi` (512K on the STM32H743) or `sram` (288K). Their initial value must be all zero
//! bytes, since no copy is stored in flash. Another value is a compile error, because the section names are those of zeroed
//! memory.
//!
//! `__pre_init` runs before anything else, enables the clocks of the memory in domain 2, and zeroes both sections. It is
//! written in assembly because no Rust code may run before statics are initialised.

/// Place a static in a section of `memory.x`. It can be taken once, as `&'static mut`.
///
/// ```ignore
/// place!(axi static BUFFERS: SelfTest = SelfTest::new());
/// let buffers: Option<&'static mut SelfTest> = BUFFERS.try_take();
/// ```
#[macro_export]
macro_rules! place {
    (axi static $name:ident: $type:ty = $value:expr) => {
        // SAFETY: `memory.x` reserves the section and `memory.rs` zeroes it.
        #[unsafe(link_section = ".bss.axi")]
        static $name: $crate::memory::Placed<$type> = $crate::memory::Placed::new($value);
    };
    (sram static $name:ident: $type:ty = $value:expr) => {
        // SAFETY: as above.
        #[unsafe(link_section = ".bss.sram")]
        static $name: $crate::memory::Placed<$type> = $crate::memory::Placed::new($value);
    };
}

pub use static_cell::ConstStaticCell as Placed;

// SAFETY: `memory.x` and cortex-m-rt define both, as words; only their addresses are taken.
unsafe extern "C" {
    static mut _stack_end: u32;
    static _stack_start: u32;
}

/// Stack high-water mark in bytes: from the first word, counted from the far end of the stack, that differs from the value
/// cortex-m-rt painted it with. A frame that did not write its lowest words is counted without them.
pub fn stack_high_water_bytes() -> usize {
    let (mut word, start) = (&raw const _stack_end, &raw const _stack_start);
    // SAFETY: the linker's symbols bound the stack; every word was painted, and no reference to any of them is created.
    // Volatile, because the words above the stack pointer change.
    while word < start && unsafe { word.read_volatile() } == cortex_m_rt::STACK_PAINT_VALUE {
        word = word.wrapping_add(1);
    }
    start as usize - word as usize
}

/// Size of the stack in bytes.
pub fn stack_bytes() -> usize {
    &raw const _stack_start as usize - &raw const _stack_end as usize
}

// Clocks of SRAM1, SRAM2 and SRAM3: bits 29, 30 and 31 of RCC_AHB2ENR (RM0433, 8.7.40). The read after the write is
// the delay that the manual requires.
#[cfg(feature = "board-h743")]
macro_rules! clocks {
    () => {
        "ldr r0, =0x580244dc
         ldr r1, [r0]
         orr r1, r1, #0xe0000000
         str r1, [r0]
         ldr r1, [r0]
         dsb"
    };
}

#[cfg(not(feature = "board-h743"))]
macro_rules! clocks {
    () => {
        ""
    };
}

core::arch::global_asm!(
    ".section .text.__pre_init, \"ax\"
     .global __pre_init
     .type __pre_init, %function
     .thumb_func
     .syntax unified
     __pre_init:",
    clocks!(),
    "    movs r2, #0
         movs r3, #0
         ldr r0, =__saxi
         ldr r1, =__eaxi
     1:  cmp r0, r1
         beq 2f
         stmia r0!, {{r2, r3}}
         b 1b
     2:  ldr r0, =__ssram
         ldr r1, =__esram
     3:  cmp r0, r1
         beq 4f
         stmia r0!, {{r2, r3}}
         b 3b
     4:  bx lr
         .ltorg
         .size __pre_init, . - __pre_init"
);
