"""Lists the words that patina-mini was taught: those of its captions that are one token each.

    train_mini captions SHARDS --count 20000 | python3 list_words.py MODEL

Writes MODEL/words.txt, one word a line, by the vocabulary in MODEL/tokenizer. `patina enhance` names words of a prompt
that are not among them, `patina models` prints them.
"""
import json
import pathlib
import re
import sys


def main(model: pathlib.Path) -> None:
    vocabulary = json.loads((model / "tokenizer" / "vocab.json").read_text())
    taught = {word for caption in sys.stdin for word in re.findall("[a-z]{2,}", caption.lower())}
    words = sorted(word for word in taught if word + "</w>" in vocabulary)
    (model / "words.txt").write_text("\n".join(words) + "\n")


main(pathlib.Path(sys.argv[1]))
