"""Trains a policy that flies to a target, evaluates it and lets it act."""

from volery.learning.training import evaluate, train

policy = train("homing", steps=20_000).policy
result = evaluate(policy, episodes=50)
action = policy.act([1.0, 0.2, 0.0, 0.0, 0.0, 0.0])
print(f"{result.success:.0%} of {result.episodes} episodes succeed; towards the target: {action}")
