# SPDX-License-Identifier: Apache-2.0
"""A run in brief, for pull requests, continuous integration and programs: Markdown, JUnit XML and JSON."""
