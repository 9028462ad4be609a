"""Fields of parts and arguments of functions: one tree of their types.

A type hint becomes a node once. The node checks values, reads them from plain data (texts with
units, "none", tables, dotted names), writes them, names what lies below it, and says in words what
it takes. Checks, files, `--set`, sweeps, options and their help ask these nodes.

msgspec, cattrs and pydantic were tried for reading and writing. Each takes longer to import than
this package (0.1 to 0.25 s), stops at a union of two dataclasses or needs a hook for it, and would
need one for every other thing that makes a scenario file pleasant: units in texts, "none", one part
or number for both axes, parts by index, a start from the values there are.
"""

from .nodes import AXES as AXES
from .nodes import CLASS_WORDS as CLASS_WORDS
from .nodes import ENTIRE as ENTIRE
from .nodes import JOINTS as JOINTS
from .nodes import KIND as KIND
from .nodes import UNSET as UNSET
from .nodes import Axis as Axis
from .nodes import Field as Field
from .nodes import Node as Node
from .nodes import Seed as Seed
from .nodes import function_name as function_name
from .nodes import join_names as join_names
from .nodes import no_field as no_field
from .tree import check_fields as check_fields
from .tree import class_of as class_of
from .tree import dotted_names as dotted_names
from .tree import field_descriptions as field_descriptions
from .tree import field_unit as field_unit
from .tree import laid_over as laid_over
from .tree import leaves as leaves
from .tree import make_part as make_part
from .tree import merged_values as merged_values
from .tree import node_of as node_of
from .tree import nodes_of as nodes_of
from .tree import of_words as of_words
from .tree import plain_data as plain_data
from .tree import value_of_text as value_of_text
from .tree import values_of as values_of
