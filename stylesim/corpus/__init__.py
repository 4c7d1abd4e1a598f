"""The on-disk form of scenes and labels; the only package that knows Parquet (see docs/corpus_format.md)."""

from stylesim.corpus.corpus import Corpus as Corpus
from stylesim.corpus.corpus import SceneInfo as SceneInfo
from stylesim.corpus.writer import CorpusWriter as CorpusWriter
from stylesim.corpus.writer import write_part as write_part
