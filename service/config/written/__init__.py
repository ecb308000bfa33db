"""What commissioning writes: the results in the user's configuration text, and the names of the files beside it.

``commissioned`` writes: ``corrections`` and ``left_out_axes`` by ``configuration_text``; ``named_files``: the files
that the text names.  ``commissioning_files``: those that are beside it.
"""
