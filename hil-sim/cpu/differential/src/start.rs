//! Vector table and entry.

use core::arch::naked_asm;

use crate::events;

unsafe extern "C" {
    static stack_top: u32;
}

/// A word of the vector table.
#[repr(C)]
union Vector {
    handler: unsafe extern "C" fn(),
    stack: *const u32,
}

// SAFETY: the table is constant.
unsafe impl Sync for Vector {}

const DISPATCH: Vector = Vector { handler: events::dispatch };

#[unsafe(link_section = ".vectors")]
#[used]
static VECTORS: [Vector; 48] = {
    let mut vectors = [DISPATCH; 48];
    vectors[0] = Vector { stack: &raw const stack_top };
    vectors[1] = Vector { handler: reset };
    vectors
};

/// Gives access to the FPU, then runs.
#[unsafe(naked)]
#[unsafe(no_mangle)]
unsafe extern "C" fn reset() {
    naked_asm!(
        "ldr r0, =0xe000ed88",
        "mov r1, #0xf00000",
        "str r1, [r0]",
        "dsb",
        "isb",
        "bl {begin}",
        ".ltorg",
        begin = sym begin,
    )
}

extern "C" fn begin() -> ! {
    crate::main();
    crate::print::exit()
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    crate::print::Line::new().text("PANIC").print();
    crate::print::exit()
}
