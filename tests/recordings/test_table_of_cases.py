"""The small files of other programs beside the repository, where they are: each is read as numpy reads it, or refused."""

import pytest
from table_of_cases import CASES, FOLDER, outcome


@pytest.mark.skipif(not FOLDER.is_dir(), reason=f"needs the files in {FOLDER}")
@pytest.mark.parametrize("name", CASES)
def test_a_file_of_another_program_is_what_numpy_reads_in_it(name):
    found = outcome(FOLDER / name, CASES[name])
    assert found.right, found
