"""What pydantic refuses, in the words of the package."""

_WORDS = {
    "bool_type": "must be true or false",
    "bool_parsing": "must be true or false",
    "dict_type": "must be a table of keys",
    "finite_number": "must be a finite number",
    "float_parsing": "must be a number",
    "float_type": "must be a number",
    "greater_than": "must be above {gt:.12g}",
    "greater_than_equal": "must be at least {ge:.12g}",
    "int_from_float": "must be a whole number",
    "int_parsing": "must be a whole number",
    "int_type": "must be a whole number",
    "less_than": "must be below {lt:.12g}",
    "less_than_equal": "must be at most {le:.12g}",
    "list_type": "must be a list, in brackets",
    "literal_error": "must be {expected}",
    "model_type": "must be a table of keys",
    "string_too_long": "must have at most {max_length} characters",
    "string_too_short": "must have at least {min_length} characters",
    "string_type": "must be text, in quotes",
    "too_long": "takes {max_length} of them at most",
    "too_short": "needs {min_length} of them or more",
    "tuple_type": "must be a list, in brackets",
}


def in_own_words(error):
    """
    What a value must be.

    Parameters
    ----------
    error : dict
        One of `pydantic.ValidationError.errors`.

    Returns
    -------
    text : str
        Pydantic's own where it has no other here.

    Examples
    --------
    >>> from pydantic import TypeAdapter, ValidationError
    >>> try:
    ...     TypeAdapter(list[int]).validate_python("5")
    ... except ValidationError as error:
    ...     in_own_words(error.errors()[0])
    'must be a list, in brackets'
    """
    known = _WORDS.get(error["type"])
    return known.format(**error.get("ctx", {})) if known else error["msg"]
