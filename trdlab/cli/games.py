"""`trdlab games`: the Atari games that there are."""

from trdlab.cli import common


def games(as_json: common.AsJson = False) -> None:
    """List the Atari games that ale-py has for one player: to train in, or to play an agent in."""
    from rich.text import Text

    from trdlab.atari import game_names
    from trdlab.runs.pretrained import pretrained_names
    from trdlab.show.text import columns

    names, trained = game_names(), pretrained_names()
    if as_json:
        told = {"schema": "trdlab.games/1", "games": list(names), "pretrained": list(trained)}
        common.print_json(told)
        return
    wide = max(map(len, names)) + 2
    beside = max(columns() // wide, 1)
    high = -(-len(names) // beside)
    lines = ("".join(f"{name:<{wide}}" for name in names[row::high]) for row in range(high))
    listed = "\n".join(line.rstrip() for line in lines)
    common.print_text(Text(f"{listed}\n" if trained else listed))
    if trained:
        common.print_line(
            f"A trained agent comes along of: {', '.join(trained)} (pretrained:GAME)."
        )
