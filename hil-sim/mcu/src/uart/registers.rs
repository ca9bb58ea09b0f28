//! The registers of a serial port (RM0440 §37.8, §38.7).

use vergence_cpu::{Cycle, Lines};

use super::{Uart, cr1, cr3, flag};
use crate::clocks::Clocks;
use crate::peripheral::{Moment, Peripheral, Registers, Reply, only};

const CR1: u32 = 0x00;
const CR2: u32 = 0x04;
const CR3: u32 = 0x08;
const BRR: u32 = 0x0C;
const RTOR: u32 = 0x14;
const RQR: u32 = 0x18;
const ISR: u32 = 0x1C;
const ICR: u32 = 0x20;
const RDR: u32 = 0x24;
const TDR: u32 = 0x28;
const PRESC: u32 = 0x2C;

const REGISTERS: Registers = &[
    (CR1, "CR1"),
    (CR2, "CR2"),
    (CR3, "CR3"),
    (BRR, "BRR"),
    (0x10, "GTPR"),
    (RTOR, "RTOR"),
    (RQR, "RQR"),
    (ISR, "ISR"),
    (ICR, "ICR"),
    (RDR, "RDR"),
    (TDR, "TDR"),
    (PRESC, "PRESC"),
];

impl Uart {
    fn flags(&self) -> u32 {
        let mut flags = self.isr | self.transmit_flags() | self.receive_flags();
        if self.is_on(cr1::TE) {
            flags |= flag::TEACK;
        }
        if self.is_on(cr1::RE) {
            flags |= flag::REACK;
        }
        flags
    }

    fn write_cr1(&mut self, moment: Moment, value: u32) -> Reply<()> {
        // Character match, end of block, wake-up and mute mode are missing; driver enable times change nothing here.
        only(value, 0xF7FF_97FD)?;
        let transmitted = self.is_on(cr1::TE);
        self.cr1 = value;
        match (transmitted, self.is_on(cr1::TE)) {
            (false, true) => self.begin_idle_frame(moment),
            (true, false) => self.stop_sending(),
            _ => {}
        }
        if self.cr1 & cr1::UE == 0 {
            self.isr = flag::TC;
            self.flush();
        }
        if !self.is_on(cr1::RE) {
            self.idle_at = None;
            self.timeout_at = None;
        }
        Ok(())
    }
}

impl Peripheral for Uart {
    fn registers(&self) -> Registers {
        REGISTERS
    }

    fn read(&mut self, _moment: Moment, offset: u32) -> Reply<u32> {
        Ok(match offset {
            CR1 => self.cr1,
            CR2 => self.cr2,
            CR3 => self.cr3,
            BRR => self.brr,
            RTOR => self.rtor,
            ISR => self.flags(),
            RDR => u32::from(self.pop()),
            PRESC => self.presc,
            _ => 0,
        })
    }

    fn write(&mut self, moment: Moment, offset: u32, value: u32) -> Reply<()> {
        match offset {
            CR1 => self.write_cr1(moment, value)?,
            CR2 => {
                // Stop bits and receiver timeout.
                only(value, 0x0080_3000)?;
                if value >> 12 & 1 == 1 {
                    return Err("half stop bits are not modelled".into());
                }
                self.cr2 = value;
            }
            CR3 => {
                // Errors, half duplex, DMA, overrun, driver enable, FIFO thresholds; no flow control, card or infrared.
                only(value, 0xFE80_F8C9)?;
                self.cr3 = value;
            }
            BRR => self.brr = value,
            RTOR => self.rtor = value,
            RQR => {
                only(value, 0x18)?;
                if value >> 3 & 1 == 1 {
                    self.flush();
                }
                if value >> 4 & 1 == 1 {
                    self.outbox.clear();
                }
            }
            ICR => self.isr &= !(value & 0x0012_3BDF),
            TDR => self.push(moment, value as u8)?,
            PRESC => self.presc = value & 0xF,
            _ => only(value, 0)?,
        }
        Ok(())
    }

    fn advance(&mut self, moment: Moment) {
        self.advance_sending(moment);
        self.advance_receiving(moment);
    }

    fn due(&self, _clocks: &Clocks) -> Cycle {
        self.sending_due().min(self.receiving_due())
    }

    fn lines(&self) -> Lines {
        const FROM_CR1: [(u32, u32); 8] = [
            (cr1::IDLEIE, flag::IDLE),
            (cr1::RXNEIE, flag::RXNE | flag::ORE),
            (cr1::TCIE, flag::TC),
            (cr1::TXEIE, flag::TXE),
            (cr1::PEIE, flag::PE),
            (cr1::RTOIE, flag::RTOF),
            (cr1::TXFEIE, flag::TXFE),
            (cr1::RXFFIE, flag::RXFF),
        ];
        const FROM_CR3: [(u32, u32); 3] =
            [(cr3::EIE, flag::FE | flag::NE | flag::ORE), (cr3::TXFTIE, flag::TXFT), (cr3::RXFTIE, flag::RXFT)];
        let flags = self.flags();
        let raised = |enabled: u32, table: &[(u32, u32)]| {
            table.iter().any(|(enable, flag)| enabled & enable != 0 && flags & flag != 0)
        };
        let any = self.cr1 & cr1::UE != 0 && (raised(self.cr1, &FROM_CR1) || raised(self.cr3, &FROM_CR3));
        if any { 1 << self.id.interrupt() } else { 0 }
    }
}
