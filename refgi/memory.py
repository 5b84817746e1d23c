"""How much memory there is for use: of the machine, or of the container that it is shared by."""

import os
from pathlib import Path


def available_bytes() -> int | None:
    """Return the bytes free for use, of machine or container, whichever is less; None where it cannot be told."""
    found = [amount for amount in (_machine_bytes(), _container_bytes()) if amount is not None]
    return min(found) if found else None


def physical_memory() -> float:
    """Return the memory that this process may have at most, in bytes; infinity where the platform does not say."""
    try:
        import resource

        present = float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
        allowed = resource.getrlimit(resource.RLIMIT_AS)[0]
    except (AttributeError, ImportError, OSError, ValueError):
        return float("inf")
    return present if allowed == resource.RLIM_INFINITY else min(present, float(allowed))


def _machine_bytes() -> int | None:
    try:
        for line in Path("/proc/meminfo").read_text().splitlines():
            if line.startswith("MemAvailable:"):
                return int(line.split()[1]) * 1024
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError, AttributeError):
        return None


def _container_bytes() -> int | None:
    group = Path("/sys/fs/cgroup")
    try:
        return int((group / "memory.max").read_text()) - int((group / "memory.current").read_text())
    except (OSError, ValueError):  # no container, or one without a limit ("max")
        return None
