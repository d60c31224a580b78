"""The discrete action and its derivatives."""
