"""Vehicle classes, and the words that sources use for them."""

import pandas as pd

CLASSES = ("car", "truck", "motorcycle", "other")
"""Classes of the canonical table."""

SYNONYMS = {
    "auto": "car",
    "pkw": "car",
    "suv": "car",
    "pickup": "car",
    "pick up": "car",
    "taxi": "car",
    "light vehicle": "car",
    "lkw": "truck",
    "heavy goods vehicle": "truck",
    "heavy truck": "truck",
    "semi trailer": "truck",
    "motorrad": "motorcycle",
    "automobile": "car",
    "passenger": "car",
    "passenger car": "car",
    "passenger vehicle": "car",
    "sedan": "car",
    "voiture": "car",
    "van": "car",
    "bus": "truck",
    "coach": "truck",
    "bus coach": "truck",
    "hgv": "truck",
    "heavy vehicle": "truck",
    "lorry": "truck",
    "trailer": "truck",
    "truck bus": "truck",
    "semi": "truck",
    "tractor trailer": "truck",
    "camion": "truck",
    "bike": "motorcycle",
    "motorbike": "motorcycle",
}
"""Other words for these classes, in lower case with blanks between words, among them those of inD, exiD, SUMO, NGSIM,
German and French tables.

A bus counts as a truck, because it is long and slow too; a van counts as a car, as in highD.
"""


def class_of(word: object) -> object:
    """The class that a word names, whatever its case, number, blanks and hyphens; the word itself if it is unknown."""
    if not isinstance(word, str):
        return word
    plain = " ".join(word.casefold().replace("_", " ").replace("-", " ").replace("/", " ").split())
    names = (plain, plain.removesuffix("s"))
    return next((name if name in CLASSES else SYNONYMS[name] for name in names if name in {*CLASSES, *SYNONYMS}), word)


NO_CLASS = "nan"
"""Code of an empty field."""


def code_of(word: object) -> str:
    """A code or word for a class as text; 1.0 and "1.0" become the code 1, and a missing value NO_CLASS."""
    return NO_CLASS if word is None or word is pd.NA or word != word else str(word).strip().removesuffix(".0")


def classes_of(words: pd.Series) -> pd.Series:
    """The classes that the words of a column name, each word looked up once."""
    if words.isin(CLASSES).all():
        return words
    known = {word: class_of(word) for word in words.dropna().unique()}
    return pd.Series(words.astype(object).map(known), index=words.index, name=words.name, dtype=object)
