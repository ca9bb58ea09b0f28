//! The STM32G474RE on its NUCLEO board: memories, clocks, timers, serial ports, DMA, flash.
