"""The course: lessons of one idea each, as pages and as notebooks.

A lesson says its idea, asks for a prediction, gives something to try, and explains. Its exercises
have a program each; the numbers of their answers are what that program finds when the page is made.
"""
