"""A blind reading: does the printed text alone tell which of three agents it is about?"""
