"""Makes patina-mini's tokenizer: CLIP's byte-level pairs, learnt on captions.

    train_mini captions SHARDS --count 20000 | python3 make_tokenizer.py MODEL/tokenizer

Needs `pip install tokenizers`. Of a vocabulary of 1,280 the captions' own words take most; words that they lack fall
into pieces and letters.
"""
import json
import pathlib
import sys

from tokenizers import Regex, Tokenizer, models, normalizers, pre_tokenizers, trainers

VOCABULARY = 1280
MAX_LENGTH = 32  # the longest caption takes 17
BEGIN, END = "<|startoftext|>", "<|endoftext|>"
# CLIP's own division of text into words.
WORDS = r"'s|'t|'re|'ve|'m|'ll|'d|\p{L}+|\p{N}|[^\s\p{L}\p{N}]+"
# What people write in prompts and captions here do not.
EXTRA = """the with and without very slightly heavily lightly completely extremely old new clean broken dirty burnt wet dry
frozen ice icy oily greasy wooden metal metallic iron steel copper brass bronze gold golden silver chrome aluminium plastic
ceramic porcelain glass stone rock concrete brick clay sand sandy mud muddy dust dusty snow snowy moss mossy lichen fungus
rust rusty corroded corrosion scratched scratches worn wear weathered aged ancient antique vintage patina verdigris peeling
flaking chipped faded paint painted cracked cracks dents dented leather fabric cloth velvet denim wool rubber marble granite
terracotta oak pine walnut varnished polished matte shiny glossy rough smooth red green blue yellow white black grey brown
orange purple pink turquoise kettle bottle car toy shoe boot helmet chair table lamp crate barrel statue bust vase pot cup
mug bowl sword shield robot monkey head box lantern camera radio house tree animal chess piece""".split()


def main(folder: pathlib.Path) -> None:
    tokenizer = Tokenizer(models.BPE(end_of_word_suffix="</w>", unk_token=END))
    tokenizer.normalizer = normalizers.Sequence([normalizers.NFC(), normalizers.Lowercase()])
    tokenizer.pre_tokenizer = pre_tokenizers.Sequence([
        pre_tokenizers.Split(Regex(WORDS), behavior="removed", invert=True),
        pre_tokenizers.ByteLevel(add_prefix_space=False, use_regex=False),
    ])
    alphabet = sorted(pre_tokenizers.ByteLevel.alphabet())
    trainer = trainers.BpeTrainer(vocab_size=VOCABULARY, initial_alphabet=alphabet, end_of_word_suffix="</w>",
                                  min_frequency=2, show_progress=False)
    captions = [line.strip() for line in sys.stdin]
    tokenizer.train_from_iterator(captions + 40 * EXTRA, trainer)
    learnt = json.loads(tokenizer.to_str())["model"]
    merges = [m if isinstance(m, str) else " ".join(m) for m in learnt["merges"]]

    # CLIP's order: the bytes, the bytes at the end of a word, the merges, the two special tokens. Merges that would not
    # fit are the last, hence the rarest.
    symbols = alphabet + [symbol + "</w>" for symbol in alphabet]
    merges = merges[:VOCABULARY - len(symbols) - 2]
    tokens = symbols + ["".join(merge.split(" ")) for merge in merges]
    tokens += [f"<|unused{i}|>" for i in range(VOCABULARY - len(tokens) - 2)] + [BEGIN, END]
    folder.mkdir(parents=True, exist_ok=True)
    vocabulary = {token: i for i, token in enumerate(tokens)}
    assert len(vocabulary) == VOCABULARY, "two merges give the same token"
    (folder / "vocab.json").write_text(json.dumps(vocabulary, ensure_ascii=False) + "\n")
    (folder / "merges.txt").write_text("#version: 0.2\n" + "\n".join(merges) + "\n")
    special = {"bos_token": BEGIN, "eos_token": END, "pad_token": END, "unk_token": END}
    (folder / "special_tokens_map.json").write_text(json.dumps(special, indent=2) + "\n")
    config = {**special, "add_prefix_space": False, "do_lower_case": True, "errors": "replace", "model_max_length": MAX_LENGTH,
              "tokenizer_class": "CLIPTokenizer"}
    (folder / "tokenizer_config.json").write_text(json.dumps(config, indent=2) + "\n")


main(pathlib.Path(sys.argv[1]))
