"""What a cluster has done so far, in numbers."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass
class Tally:
    """Counts since the cluster was first used; bytes are those of scenes and sums."""

    portions: int = 0  # that came in
    retried: int = 0  # given to another worker, since the first was lost or failed
    doubled: int = 0  # given to another worker too, since the first was slow
    lost: int = 0  # workers
    bytes_sent: int = 0
    bytes_received: int = 0
    refused: dict[str, str] = field(default_factory=dict)  # address -> why
    shown_equal: dict[str, str] = field(default_factory=dict)  # address -> what differs

    def __str__(self) -> str:
        """Return a line for the user."""
        words = [f"{self.portions} portion{'' if self.portions == 1 else 's'}"]
        for count, noun, verb in (
            (self.retried, "", "retried"),
            (self.doubled, "", "doubled"),
            (self.lost, "worker", "lost"),
            (len(self.refused), "worker", "refused"),
        ):
            if count:
                plural = "s" if noun and count > 1 else ""
                words.append(" ".join(f"{count} {noun}{plural} {verb}".split()))
        sent, received = self.bytes_sent / 1e6, self.bytes_received / 1e6
        return ", ".join([*words, f"{sent:.1f} MB sent, {received:.1f} MB received"])
