"""Files that are damaged at random, and files made to do harm: how loading them ends.

`make fuzz`, or in this folder's parent: python -m fuzz --count 3000 --seed 1
"""
