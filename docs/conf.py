"""Sphinx's configuration: `make docs` here, rosdoc2 on the ROS build farm."""

import re

from sphinx.ext.napoleon import Config, GoogleDocstring

project = 'dcdrw'
author = 'dcdrw developers'
copyright = 'dcdrw developers, Apache-2.0'
extensions = [
    'myst_parser',
    'sphinx.ext.autodoc',
    'sphinx.ext.autosummary',
]
rosdoc2_settings = {'allow_other_extensions': True}
templates_path = ['_templates']
exclude_patterns = ['conf.py']
source_suffix = {'.rst': 'restructuredtext', '.md': 'markdown', '.py': 'markdown'}
html_theme = 'sphinx_rtd_theme'
html_theme_options = {'navigation_depth': 3}
html_show_sourcelink = False
html_static_path = ['_static']
html_css_files = ['site.css']

myst_heading_anchors = 4
default_role = 'code'
autodoc_member_order = 'bysource'
suppress_warnings = ['ref.python']  # a type such as `type` is a field of several classes, too


def page_of_script(app, docname, source):
    """A tutorial is a script in cells, `# %%` before code and `# %% [markdown]` before text in comments."""
    if docname.startswith('tutorials/'):
        cells = re.split(r'^# %%(.*)\n', source[0], flags=re.MULTILINE)[1:]
        source[0] = ''.join(
            re.sub(r'^# ?', '', cell, flags=re.MULTILINE)
            if 'markdown' in kind
            else f'```python\n{cell.strip()}\n```\n\n'
            for kind, cell in zip(cells[::2], cells[1::2], strict=True)
        )


def leave_front_page(app, docname, source):
    """What the README's readers find in the repository has other names on the site."""
    source[0] = source[0].replace('](../README.md)', '](index.md)')


def read_docstring(app, what, name, obj, options, lines):
    """Docstrings are plain text with `code` in it, |n| and *args are no markup, and sections as Google has them."""
    lines[:] = [re.sub(r'(`[^`]*`)|([|*\\])|(?<=\w)_(?!\w)', lambda m: m[1] or '\\' + m[0], line) for line in lines]
    if what not in ('attribute', 'property', 'data'):  # where a colon would end a type
        lines[:] = GoogleDocstring(lines, Config(), app, what, name, obj, options).lines()


def setup(app):
    """Sphinx calls this."""
    app.connect('source-read', page_of_script)
    app.connect('source-read', leave_front_page)
    app.connect('autodoc-process-docstring', read_docstring)
