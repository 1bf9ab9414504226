"""What a process under test costs the machine."""

from dataclasses import dataclass

import psutil

from harness.processes import Process

MEBIBYTE = 2**20


@dataclass(frozen=True)
class Burden:
    """What a process holds."""

    memory: int
    threads: int
    descriptors: int

    @classmethod
    def of(cls, process: Process) -> "Burden":
        seen = psutil.Process(process.pid)
        return cls(seen.memory_info().rss, seen.num_threads(), seen.num_fds())

    def __str__(self) -> str:
        return (
            f"{self.memory / MEBIBYTE:.1f} MiB, {self.threads} threads, "
            f"{self.descriptors} descriptors"
        )
